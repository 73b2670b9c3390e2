"""What there is to be seen of a recording: the characters of one world, state by state."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain

import numpy as np

from actuated_characters.bags.recording import Recording, Wrenches
from actuated_characters.bags.thrown_balls import ThrownBall, thrown_balls
from actuated_characters.render.engine.posed_characters import LinkForce
from actuated_characters.render.engine.renderer import FrameSpec
from actuated_characters.render.pushed_stills import Ticks
from actuated_characters.render.skin.palette import color_number
from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.character.model import Character, Pose, Shape, ShapeType, UrdfOptions
from msgs_config.errors import ConfigurationError, RecordingError
from msgs_config.geometry import rotations
from msgs_config.messages.wrenches import WrenchArrays
from msgs_config.shared_parameters import PLANE

_UNKNOWN = Shape(ShapeType.SPHERE, (0.1,))  # of what was thrown before the recording begins
_SHORTEST_ARROW = 0.25  # length of the shortest arrow, as a share of the longest one's
_OF_STATES = (
    *("stamps_ns", "published_ns", "position", "velocity"),
    *("reference_position", "reference_velocity", "balls", "pins", "commands"),
)
_OF_TICKS = ("effort", "contacts", "applied_wrench", "throws")


@dataclass(frozen=True)
class RecordedScene:
    """The characters of one world over t ticks; n degrees of freedom in all.

    Arrays have those of one character after those of another, and so it is with the links (l).
    """

    recordings: tuple[Recording, ...]  # recordings of the same ticks

    @property
    def characters(self) -> tuple[Character, ...]:
        """As they stood there."""
        return tuple(recording.character for recording in self.recordings)

    @property
    def color_numbers(self) -> tuple[int, ...]:
        """Which colours each of them has, as in the viewer."""
        return tuple(color_number(each.world, k) for k, each in enumerate(self.recordings))

    @property
    def times(self) -> FloatArray:
        """Simulation time (t + 1,) of each state since the first one, s."""
        return self.recordings[0].times

    @property
    def ground(self) -> bool:
        """Whether there was the plane z = 0."""
        return bool(self.recordings[0].parameters.get("terrain", PLANE) == PLANE)

    @property
    def terrain(self) -> UrdfOptions | None:
        """What else lay there."""
        return self.recordings[0].world.terrain

    @cached_property
    def position(self) -> FloatArray:
        """Positions (t + 1, n), message form."""
        return np.hstack([recording.position for recording in self.recordings])

    @cached_property
    def reference(self) -> FloatArray:
        """Reference positions (t + 1, n), NaN where a character had none."""
        return np.hstack([recording.reference_position for recording in self.recordings])

    @property
    def has_reference(self) -> bool:
        """Whether any character ever had one."""
        return bool(np.isfinite(self.reference).any())

    @property
    def episode_rows(self) -> IntArray:
        """Rows of the first states of episodes; the first row is one."""
        return self.recordings[0].episode_rows

    def frames(
        self,
        rows: IntArray,
        captions: Sequence[str],
        *,
        ghosts: bool,
        contacts: bool = False,
        pushes: Sequence[Sequence[Ticks]] | None = None,
    ) -> list[FrameSpec]:
        """What pictures of some states (p,) show, without their views; captions (p,).

        With the references as ghosts if wanted, and with the links marked that touched something.
        Pushes and contacts are those of the ticks since the state before, and of the one that led
        to the first state; `pushes` says otherwise of which ticks each picture's (p,) are. Of a
        link its strongest push is shown. The recording's strongest push has the longest arrow, and
        none has less than a part of it.
        """
        since = list(_ticks(rows))
        pushes = [[each] for each in since] if pushes is None else pushes
        return [
            FrameSpec(
                self.position[row],
                ghost=self.reference[row] if ghosts else None,
                forces=self._forces(pushed),
                touching=self._touching(*ticks) if contacts else None,
                balls=self._balls(row),
                caption=caption,
            )
            for row, ticks, pushed, caption in zip(
                rows.tolist(), since, pushes, captions, strict=True
            )
        ]

    def push_ticks(self) -> list[Ticks]:
        """The ticks of each push: those one after another in which one link was pushed."""
        acted: dict[int, list[int]] = {}
        for links, tick, acting in self._acting_at("applied_wrench", 0, None):
            norms = _norms(acting).tolist()
            for link in {n for n, norm in zip(acting.links, norms, strict=True) if norm > 0.0}:
                if link in links:
                    acted.setdefault(links[link], []).append(tick)
        return [
            (int(part[0]), int(part[-1]) + 1)
            for ticks in acted.values()
            for part in np.split(ticks, np.flatnonzero(np.diff(ticks) > 1) + 1)
        ]

    def _balls(self, row: int) -> list[Shape]:
        """The balls and boxes that are there in a state, with their poses in the world."""
        recording = self.recordings[0]
        states = recording.balls[row] if recording.balls else None
        if states is None:
            return []
        shapes = self.ball_shapes(row, states.names)
        return [
            # How a ball is turned is not seen, but by the triangles that it is drawn with.
            replace(shape, pose=Pose.of_arrays(pose[:3], _turn(shape, pose[3:])))
            for shape, pose in zip(shapes, states.motion[:, :7], strict=True)
        ]

    def ball_shapes(self, row: int, names: Sequence[str]) -> list[Shape]:
        """The shapes of balls and boxes that are there in a state, by their names."""
        first = int(self.episode_rows[np.searchsorted(self.episode_rows, row, side="right") - 1])
        shapes = {each.name: each.throw.shape for each in self._thrown.get(first, ())}
        return [shapes.get(name, _UNKNOWN) for name in names]

    @cached_property
    def _thrown(self) -> dict[int, tuple[ThrownBall, ...]]:
        """The balls whose throws were recorded, by the first row of their episode."""
        return thrown_balls(self.recordings[0])

    def _touching(self, begin: int, end: int) -> BoolArray:
        """Which links (l,) touched something in ticks from one to before another."""
        touched = np.zeros(len(self._centres), dtype=np.bool_)
        for links, acting in self._acting("contacts", begin, end):
            touched[[links[name] for name in acting.links if name in links]] = True
        return touched

    def _forces(self, pushed: Iterable[Ticks]) -> tuple[LinkForce, ...]:
        """The strongest push of each link in some ticks."""
        strongest: dict[int, tuple[float, LinkForce]] = {}
        for links, acting in chain(*(self._acting("applied_wrench", *each) for each in pushed)):
            for number, norm in enumerate(_norms(acting).tolist()):
                link = links.get(acting.links[number])
                if link is None or norm == 0.0 or norm <= strongest.get(link, (0.0,))[0]:
                    continue
                share = _SHORTEST_ARROW + (1.0 - _SHORTEST_ARROW) * norm / self._strongest
                has_points = len(acting.points) > 0
                point = acting.points[number] if has_points else self._centres[link]
                arrow = acting.wrenches[number, :3] * (share / norm)
                strongest[link] = norm, LinkForce(link, point, arrow)
        return tuple(force for _, force in strongest.values())

    def _acting(
        self, what: str, begin: int, end: int | None
    ) -> Iterator[tuple[dict[str, int], WrenchArrays]]:
        """Contacts or pushes in ticks from one to before another, and links by their names."""
        for links, _, acting in self._acting_at(what, begin, end):
            yield links, acting

    def _acting_at(
        self, what: str, begin: int, end: int | None
    ) -> Iterator[tuple[dict[str, int], int, WrenchArrays]]:
        """The same, with the tick of each."""
        first = 0
        for recording in self.recordings:
            names = [link.name for link in recording.character.links]
            links = {name: first + row for row, name in enumerate(names)}
            wrenches: Wrenches = getattr(recording, what)
            for tick, acting in enumerate(wrenches[begin:end], start=begin):
                if acting is not None:
                    yield links, tick, acting
            first += len(names)

    @cached_property
    def _strongest(self) -> float:
        """Norm of the strongest push, N."""
        every = self._acting("applied_wrench", 0, None)
        return max(float(_norms(acting).max(initial=0.0)) for _, acting in every)

    @cached_property
    def _centres(self) -> FloatArray:
        """Centres of mass (l, 3) of the links in their frames, m."""
        links = [link for character in self.characters for link in character.links]
        return np.array([link.inertial_pose.position for link in links])


def make_scene(recordings: Sequence[Recording]) -> RecordedScene:
    """The scene of the characters of one world, over the ticks that there are of all of them.

    Raises:
        RecordingError: they are of several worlds, or have no tick in common.
    """
    worlds = sorted({recording.world.namespace for recording in recordings})
    if len(worlds) > 1:
        names = ", ".join(recording.name for recording in recordings)
        raise RecordingError(
            f"the recording has several worlds ({', '.join(map(repr, worlds))}); "
            f"name one character of these: {names}"
        )
    first = max(int(recording.stamps_ns[0]) for recording in recordings)
    last = min(int(recording.stamps_ns[-1]) for recording in recordings)
    if first > last:
        raise RecordingError("the recording has no tick that all its characters have")
    return RecordedScene(tuple(_cut(recording, first, last) for recording in recordings))


def _cut(recording: Recording, first_ns: int, last_ns: int) -> Recording:
    """What is seen of a recording, from one stamp to another."""
    begin, end = np.searchsorted(recording.stamps_ns, (first_ns, last_ns)).tolist()
    parts = dict.fromkeys(_OF_STATES, slice(begin, end + 1)) | dict.fromkeys(
        _OF_TICKS, slice(begin, end)
    )
    return replace(recording, **{name: getattr(recording, name)[p] for name, p in parts.items()})


def _ticks(rows: IntArray) -> Iterator[tuple[int, int]]:
    """First tick, and the one after the last, that led to each of some states (p,)."""
    before = max(int(rows[0]) - 1, 0)
    for row in rows.tolist():
        yield min(before, max(row - 1, 0)), row
        before = row


def _turn(shape: Shape, turn_xyzw: FloatArray) -> FloatArray:
    return np.array(rotations.IDENTITY_XYZW) if shape.type is ShapeType.SPHERE else turn_xyzw


def _norms(acting: WrenchArrays) -> FloatArray:
    """Norms (m,) of the forces, N."""
    norms: FloatArray = np.linalg.norm(acting.wrenches[:, :3], axis=1)
    return norms


def part_of(times: FloatArray, start: float, end: float | None) -> tuple[float, float]:
    """A part of states at times (t + 1,), from a start to an end in s, by default the last state's.

    Raises:
        ConfigurationError: it is empty, or the states do not reach so far.
    """
    last = float(times[-1])
    end = last if end is None else end
    if not 0.0 <= start <= end <= last:
        raise ConfigurationError(
            f"from {start:g} s to {end:g} s is not in the recording: 0 to {last:g} s"
        )
    return start, end
