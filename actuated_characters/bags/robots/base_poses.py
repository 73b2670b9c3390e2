"""Where a robot's base is over time: from `tf`, an odometry, or a topic of poses."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from actuated_characters.bags.robots.decoding import Timed, read_timed, stamp_ns
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character, Pose
from msgs_config.errors import ConfigurationError, RecordingError, one_of
from msgs_config.geometry import rotations

NO_BASE = "none"
_TRANSFORMS = "tf2_msgs/msg/TFMessage"
_ODOMETRY = "nav_msgs/msg/Odometry"
_POSES = tuple(
    f"geometry_msgs/msg/{name}"
    for name in ("PoseStamped", "PoseWithCovarianceStamped", "TransformStamped", "Pose")
)
_WORDS_OF_A_GOAL = ("goal", "target", "cmd", "command", "desired", "setpoint", "initialpose")
_MOST_FRAMES = 64  # frames from the base up to the world
_LEAST_NORM = 1e-6  # least norm of a quaternion that is taken for an orientation


class Stamped(NamedTuple):
    """A pose with the stamp of its header, 0 where none is set, and when it was logged."""

    stamp_ns: int
    log_time_ns: int
    row: tuple[float, ...]  # (7,): m, and the orientation xyzw


@dataclass
class PoseTrack:
    """The poses of a frame in its parent, one after another."""

    parent: str = ""
    poses: list[Stamped] = field(default_factory=list)
    is_static: bool = False

    def at(self, stamps_ns: IntArray, log_times_ns: IntArray) -> FloatArray:
        """Poses (r, 7) at some times, by the headers' clock or, where it is another, by log time.

        Between two poses along the straight way and the shortest turn; before the first and after
        the last one those.
        """
        rows = np.array([pose.row for pose in self.poses])
        rows[:, 3:] = rotations.normalised(rows[:, 3:])
        own = np.array([pose.stamp_ns for pose in self.poses])
        wanted = stamps_ns
        apart = own.min() > stamps_ns[-1] or own.max() < stamps_ns[0]
        if not own.all() or apart:
            own, wanted = np.array([pose.log_time_ns for pose in self.poses]), log_times_ns
        order = np.argsort(own, kind="stable")
        own, rows = own[order], rows[order]
        if self.is_static or len(own) == 1:
            return np.tile(rows[-1], (len(wanted), 1))
        after = np.searchsorted(own, wanted, side="right").clip(1, len(own) - 1)
        before = after - 1
        spans = np.maximum(own[after] - own[before], 1)
        share = ((wanted - own[before]) / spans).clip(0.0, 1.0)[:, np.newaxis]
        between = np.empty((len(wanted), 7))
        between[:, :3] = rows[before, :3] + share * (rows[after, :3] - rows[before, :3])
        turns = rotations.multiply(rotations.conjugate(rows[before, 3:]), rows[after, 3:])
        part = rotations.exp(share * rotations.log(turns))
        between[:, 3:] = rotations.multiply(rows[before, 3:], part)
        return between


def compose(outer: FloatArray, inner: FloatArray) -> FloatArray:
    """Poses (r, 7) of frames given in others, whose own poses are the outer ones."""
    position = outer[:, :3] + rotations.rotate(outer[:, 3:], inner[:, :3])
    return np.hstack((position, rotations.multiply(outer[:, 3:], inner[:, 3:])))


def inverse(pose: Pose) -> FloatArray:
    """The pose (1, 7) of a parent in the frame that has a pose in it."""
    turn = rotations.conjugate(np.array(pose.orientation_xyzw))
    position = -rotations.rotate(turn, np.array(pose.position))
    return np.concatenate((position, turn))[np.newaxis]


def base_frames(character: Character) -> dict[str, Pose]:
    """The frames that do not move in the base, the base first, and their poses in it."""
    found = {character.links[0].name: Pose()}
    for link in character.links[1:]:
        parent = character.links[link.parent].name
        if link.joint.type is JointType.FIXED and parent in found:
            found[link.name] = _inside(found[parent], link.joint.pose_in_parent)
    for frame in character.frames:
        if frame.parent in found:
            found[frame.name] = _inside(found[frame.parent], frame.pose)
    return found


def _inside(outer: Pose, inner: Pose) -> Pose:
    rows = [np.array([(*p.position, *p.orientation_xyzw)]) for p in (outer, inner)]
    (row,) = compose(*rows)
    return Pose.of_arrays(row[:3], row[3:])


@dataclass(frozen=True)
class BaseMotion:
    """Where the base is, as a sum of tracks from the world to a frame that is fixed to it."""

    source: str  # the topic that the poses come from
    tracks: tuple[PoseTrack, ...]  # the chain of poses, the first one in the world
    frame: Pose  # pose of the last track's frame in the base
    remark: str = ""

    def at(self, stamps_ns: IntArray, log_times_ns: IntArray) -> FloatArray:
        """Poses (r, 7) of the base in the world."""
        pose = self.tracks[0].at(stamps_ns, log_times_ns)
        for track in self.tracks[1:]:
            pose = compose(pose, track.at(stamps_ns, log_times_ns))
        return compose(pose, np.tile(inverse(self.frame), (len(pose), 1)))


def find_base(
    bag: Path, types: Mapping[str, str], frames: Mapping[str, Pose], beside: str, wanted: str | None
) -> BaseMotion | None:
    """How the base moves, as far as a bag says; None if it does not.

    `tf` comes first where it moves the base, then an odometry, then a topic of poses, then a
    transform that stands still.

    Args:
        bag: The bag.
        types: The types of its topics.
        frames: The frames that are fixed to the base; see `base_frames`.
        beside: The topic of joint states; topics of its namespace come first.
        wanted: The topic that is to be taken alone; `NO_BASE` for none.

    Raises:
        ConfigurationError: there is no such topic, or it has no poses.
        RecordingError: the bag cannot be read.
    """
    if wanted == NO_BASE:
        return None
    named = None if wanted is None else _chosen(types, wanted)
    transforms = [name for name in types if types[name] == _TRANSFORMS]
    if named is not None and types[named] != _TRANSFORMS:
        return _of_topic(bag, named, types[named], frames)
    chain = _of_transforms(bag, _nearest(transforms, beside), frames, beside)
    if chain is not None and (named or not all(track.is_static for track in chain.tracks)):
        return chain
    if named is not None:
        raise RecordingError(f"'{named}' has no transform of {', '.join(frames)}")
    for kind in ((_ODOMETRY,), _POSES):
        names = [name for name in types if types[name] in kind and not _is_wanted(name)]
        for name in _nearest(names, beside):
            found = _of_topic(bag, name, types[name], frames)
            if found is not None:
                others = ", ".join(sorted(set(names) - {name}))
                also = f" (there are also {others}; --base names one)" if others else ""
                return BaseMotion(name, found.tracks, found.frame, found.remark + also)
    return chain


def _chosen(types: Mapping[str, str], wanted: str) -> str:
    """The topic that is asked for, with or without its leading slash."""
    choices = [n for n in types if types[n] in (_TRANSFORMS, _ODOMETRY, *_POSES)]
    for name in (wanted, f"/{wanted}"):
        if name in choices:
            return name
    if wanted in types or f"/{wanted}" in types:
        kind = types.get(wanted) or types[f"/{wanted}"]
        kinds = ", ".join((_TRANSFORMS, _ODOMETRY, *_POSES))
        raise ConfigurationError(f"--base {wanted}: it is a {kind}; it must be one of {kinds}")
    raise ConfigurationError(one_of("topic of --base", wanted, [*choices, NO_BASE]))


def _nearest(names: Sequence[str], beside: str) -> list[str]:
    """Topics, those of the other topic's namespace first, then those of no namespace."""
    folder = beside.rpartition("/")[0]

    def distance(name: str) -> tuple[bool, bool, bool, str]:
        own = name.rpartition("/")[0]
        return own != folder, own.strip("/") != "", not name.endswith("odom"), name

    return sorted(names, key=distance)


def _is_wanted(name: str) -> bool:
    """Whether a topic says where something should be, and not where it is."""
    return any(word in name.lower() for word in _WORDS_OF_A_GOAL)


def _of_topic(bag: Path, topic: str, kind: str, frames: Mapping[str, Pose]) -> BaseMotion | None:
    """The base by an odometry or by poses; None without a message."""
    track, child = PoseTrack(), ""
    for timed in read_timed(bag, topic):
        content = timed.content
        child = str(getattr(content, "child_frame_id", child))
        pose = content.transform if kind.endswith("TransformStamped") else content
        while hasattr(pose, "pose"):  # the pose is within: below a header, or beside a covariance
            pose = pose.pose
        _append(track, getattr(content, "header", None), timed, pose)
    if not track.poses:
        return None
    frame = _frame_of(child, frames)
    remark = f"the base is that of '{topic}'"
    if child and frame is None:
        remark += f", whose frame '{child}' is taken for {next(iter(frames))}"
    return BaseMotion(topic, (track,), frames[frame] if frame else Pose(), remark)


def _append(track: PoseTrack, header: Any, timed: Timed, pose: Any) -> None:
    """Add a pose or a transform, unless it is none."""
    place = pose.translation if hasattr(pose, "translation") else pose.position
    turn = pose.rotation if hasattr(pose, "rotation") else pose.orientation
    row = (place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w)
    if np.isfinite(row).all() and np.linalg.norm(row[3:]) > _LEAST_NORM:
        stamp = 0 if header is None else stamp_ns(header)
        track.poses.append(Stamped(stamp, timed.log_time_ns, row))


def _frame_of(name: str, frames: Mapping[str, Pose]) -> str | None:
    """The frame of a message's name, which may have a robot's before it, as in `left/base_link`."""
    whole = name.strip("/")
    for frame in frames:
        if whole == frame or whole.endswith(f"/{frame}"):
            return frame
    return None


def _of_transforms(
    bag: Path, topics: Sequence[str], frames: Mapping[str, Pose], beside: str
) -> BaseMotion | None:
    """The base by the chain of transforms above one of its frames; None if there is none.

    Of several robots' frames those count that begin with the namespace of the joint states.
    """
    tracks: dict[str, PoseTrack] = {}
    for topic in topics:
        is_static = topic.endswith("static")
        for timed in read_timed(bag, topic):
            for each in timed.content.transforms:
                _take(tracks, each, timed, is_static=is_static)
    prefix = beside.rpartition("/")[0].strip("/") + "/"
    for child in sorted(_known(tracks, frames), key=lambda name: not name.startswith(prefix)):
        chain, name = list[PoseTrack](), child
        while name in tracks and len(chain) < _MOST_FRAMES:
            chain.insert(0, tracks[name])
            name = tracks[name].parent
        frame = _frame_of(child, frames)
        assert frame is not None
        remark = f"the base is that of tf, from '{name}' to '{child}'"
        return BaseMotion("tf", tuple(chain), frames[frame], remark)
    return None


def _known(tracks: Mapping[str, PoseTrack], frames: Mapping[str, Pose]) -> Iterator[str]:
    """The frames of tf that are fixed to the base, and whose parents are not."""
    for name, track in tracks.items():
        if _frame_of(name, frames) is not None and _frame_of(track.parent, frames) is None:
            yield name


def _take(tracks: dict[str, PoseTrack], sent: Any, timed: Timed, *, is_static: bool) -> None:
    """Add a transform to those of its child; a frame that moves is not static."""
    child = sent.child_frame_id.strip("/")
    known = tracks.get(child)
    if known is None or (known.is_static and not is_static):
        known = tracks[child] = PoseTrack(is_static=is_static)
    if known.is_static or not is_static:
        known.parent = sent.header.frame_id.strip("/")
        _append(known, sent.header, timed, sent.transform)
        if not known.poses:
            del tracks[child]
