"""A library of captured motion, and which moment of it is nearest to how a character moves.

The search of Zordan, Majkowska, Chiu and Fast 2005, "Dynamic Response for Motion Capture
Animation": a weighted distance of the bodies' positions and orientations over a window. Where on
the ground a motion happens does not count: each moment is moved to the root's place, and turned
about z to where its links' origins are nearest (Kovar, Gleicher and Pighin 2002, "Motion Graphs").
"""

import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller_node.references.base import Reference
from controller_node.references.clip import ClipReference
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character, Vector
from msgs_config.clips.reading import available_clips, expand_clips, read_clip
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.geometry import elementary, fixed_order, rotations

_RATE = 30.0  # samples a second
_WINDOW = 7  # samples, 0.2 s
_MIN_LINK_LENGTH = 0.05  # m, the least length of a link


@dataclass(frozen=True)
class Match:
    """A moment of the library."""

    clip: str
    time: float  # s since the clip's first frame
    turn: float  # rad about z, that turns the clip to where it is nearest
    distance: float  # m
    median: float  # m, of the distances of all moments that were compared

    def content(self) -> dict[str, object]:
        """The match as JSON has it."""
        return {
            "clip": self.clip,
            "clip_time": self.time,
            "distance": self.distance,
            "median_distance": self.median,
        }


@dataclass(frozen=True)
class Window:
    """How links move over a window, from below the root's place at its start; world axes."""

    positions: FloatArray  # (..., w, links, 3) of their origins, m
    turns_xyzw: FloatArray  # (..., w, links, 4)


class MotionLibrary:
    """Every moment of some clips that a motion may go on with for a time."""

    def __init__(
        self, character: Character, clips: Sequence[str], lasting: float, share: float = 1.0
    ) -> None:
        """Read clips; all that the character has if none is named.

        Moments of a clip that does not wrap are followed by `lasting` s of it, or left out, and
        are of its first part if `share` is below 1.

        Raises:
            ConfigurationError: a clip does not exist, or no moment is left.
            ClipError: a clip is malformed.
        """
        names = clips_of_library(character, clips)
        self._layout = character.layout
        self._model = DynamicsModel(character)
        masses = np.array([link.mass for link in character.links])
        self._weights = np.tile(masses / (_WINDOW * character.mass), _WINDOW)  # (k,), k = w links
        self._lengths = np.tile(_lengths(character), _WINDOW)  # (k,)
        self.references = dict[str, Reference]()
        self._durations = dict[str, float]()
        clips_of, times, windows = list[str](), list[float](), list[Window]()
        for name in names:
            frames = read_clip(character, name)
            self.references[name] = ClipReference(character.layout, frames)
            self._durations[name] = end = float(frames.times[-1])
            last = end - 1.0 / _RATE if frames.wraps else end - max(lasting, _WINDOW / _RATE)
            last = min(last, share * end)
            count = int(np.floor(last * _RATE + 1e-9)) + 1
            if count > 0:
                clips_of += [name] * count
                times += [number / _RATE for number in range(count)]
                windows.append(self._moments(self.references[name], count))
        if not times:
            raise ConfigurationError(
                f"parameter 'library': no clip of {', '.join(names)} lasts {lasting:g} s and more"
            )
        self.clips, self.times = np.array(clips_of), np.array(times)
        self._keep(windows)

    def _keep(self, windows: Sequence[Window]) -> None:
        """Keep windows component by component, as a search reads them from end to end."""
        places = _flat([window.positions for window in windows])
        self._weighted = places * self._weights  # (3, f, k), of f moments
        self._squares = fixed_order.total(fixed_order.dot(self._weighted, places), axis=0)  # (f,)
        self._turns = _flat([window.turns_xyzw for window in windows])  # (4, f, k)

    def __len__(self) -> int:
        return len(self.times)

    def duration(self, clip: str) -> float:
        """Length in s of a clip of the library."""
        return self._durations[clip]

    def nearest(self, window: Window, among: str = "") -> Match:
        """The moment nearest to a window of motion, of all clips or one."""
        distances, turns = self.distances(window)
        if among:
            distances = np.where(self.clips == among, distances, np.inf)
        moment = int(np.argmin(distances))
        return Match(
            str(self.clips[moment]),
            float(self.times[moment]),
            float(turns[moment]),
            float(distances[moment]),
            statistics.median(distances[np.isfinite(distances)].tolist()),
        )

    def distances(self, window: Window) -> tuple[FloatArray, FloatArray]:
        """Distance (moments,) in m of each moment from a window, turned by (moments,) rad about z.

        The root of the mean over window and links, weighted by mass, of the squared distance of
        the origins and of the squared length of the arc that a link's end would have to turn by.
        """
        x, y, z = _flat([window.positions[np.newaxis]])[:, 0]
        by_x, by_y, by_z = self._weighted
        along = fixed_order.dot(by_x, x) + fixed_order.dot(by_y, y)
        across = fixed_order.dot(by_x, y) - fixed_order.dot(by_y, x)
        turns = elementary.arctan2(across, along)
        square = self._squares + fixed_order.dot(self._weights, x * x + y * y + z * z)
        moved = np.sqrt(along * along + across * across)
        square -= 2.0 * (moved + fixed_order.dot(by_z, z))
        arcs = self._angles(_flat([window.turns_xyzw[np.newaxis]])[:, 0], turns) * self._lengths
        square += fixed_order.dot(arcs * arcs, self._weights)
        return np.sqrt(np.maximum(square, 0.0)), turns

    def _angles(self, turns_xyzw: FloatArray, about_z: FloatArray) -> FloatArray:
        """Angles (f, k) between the moments' links, turned about z (f,), and others (4, k).

        Half of one has the cosine `q . (r p)`, with r the turn about z; that is linear in r, and
        for r the quaternion k it is `q . (k p)`.
        """
        x, y, z, w = turns_xyzw
        theirs = self._turns
        same = theirs[0] * x + theirs[1] * y + theirs[2] * z + theirs[3] * w
        turned = theirs[0] * y - theirs[1] * x - theirs[2] * w + theirs[3] * z
        same *= elementary.cos(0.5 * about_z)[:, np.newaxis]
        turned *= elementary.sin(0.5 * about_z)[:, np.newaxis]
        angles: FloatArray = 2.0 * elementary.arccos(np.minimum(np.abs(same + turned), 1.0))
        return angles

    def predicted(self, position: FloatArray, velocity: FloatArray) -> Window:
        """The window that begins with a state (n,), its velocities kept."""
        entries, layout = self._layout.rotation_entries, self._layout
        turns = layout.configuration(position).orientations_xyzw
        states = []
        for number in range(_WINDOW):
            elapsed = number / _RATE
            carried = position + elapsed * velocity
            ahead = rotations.multiply(turns, rotations.exp(elapsed * velocity[entries]))
            carried[entries] = rotations.log(ahead)
            states.append(carried)
        return _from_below(*self._links(np.array(states)), position)

    def _moments(self, reference: Reference, count: int) -> Window:
        """The windows that begin at the first `count` samples of a clip."""
        times = (number / _RATE for number in range(count + _WINDOW - 1))
        samples = np.array([reference.sample(time).configuration.position for time in times])
        origins, turns = self._links(samples)
        rows = np.arange(count)[:, np.newaxis] + np.arange(_WINDOW)
        return _from_below(origins[rows], turns[rows], samples[:count])

    def _links(self, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Origins (w, links, 3) and turns (w, links, 4) in the world at positions (w, n)."""
        still, poses = np.zeros(self._layout.size), []
        for position in positions:
            self._model.update(position, still)
            poses.append(self._model.link_poses())
        return np.array([pose[0] for pose in poses]), np.array([pose[1] for pose in poses])


def _flat(windows: Sequence[FloatArray]) -> FloatArray:
    """Arrays (f, w, links, i) one after the other, and turned round: (i, f, w links)."""
    whole = np.concatenate(windows)
    moments, samples, links, components = whole.shape
    rows = whole.reshape(moments, samples * links, components)
    return np.ascontiguousarray(np.moveaxis(rows, -1, 0))


def _from_below(origins: FloatArray, turns_xyzw: FloatArray, root: FloatArray) -> Window:
    """Windows (..., w, links) seen from the ground below a root's place, of positions (..., n)."""
    below = root[..., :3] * np.array((1.0, 1.0, 0.0))
    return Window(origins - below[..., np.newaxis, np.newaxis, :], turns_xyzw)


def clips_of_library(character: Character, clips: Sequence[str]) -> list[str]:
    """The clips that are named, those of folders in their place; all if none is.

    Raises:
        ConfigurationError: one does not exist, or the character has none.
        ClipError: a folder has none.
    """
    available = available_clips(character)
    if not available:
        raise ConfigurationError(
            f"the behaviour needs a library of clips, and character '{character.name}' has none: "
            "its file has no key 'clips', or nothing is there"
        )
    for clip in clips:
        if clip not in available and not Path(clip).exists():
            sentence = one_of("clip in parameter 'library':", clip, available)
            raise ConfigurationError(f"{sentence}; or a .json file, or a folder of them")
    return expand_clips(character, clips) or available


def _lengths(character: Character) -> FloatArray:
    """Length (links,) of each link in m: to its farthest child, or through its centre of mass."""
    lengths = [2.0 * _length(link.inertial_pose.position) for link in character.links]
    for link in character.links:
        if link.parent >= 0:
            far = _length(link.joint.pose_in_parent.position)
            lengths[link.parent] = max(lengths[link.parent], far)
    clipped: FloatArray = np.maximum(np.array(lengths), _MIN_LINK_LENGTH)
    return clipped


def _length(vector: Vector) -> float:
    return float(fixed_order.norm(np.array(vector)))
