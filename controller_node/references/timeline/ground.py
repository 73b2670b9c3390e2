"""The lowest track of a timeline: clips and steering one after another, each from where it is."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace

from controller_node.references.base import REFERENCES, Reference, ReferenceState
from controller_node.references.clip import ClipReference
from controller_node.references.hold import HoldReference
from controller_node.references.inertialised import InertializationOffset
from controller_node.references.posture import Posture
from controller_node.references.steering.reference import SteeredReference
from controller_node.references.steering.velocity import VelocityCommand
from controller_node.references.timeline.description import ClipEntry, SteeringEntry, Timeline
from controller_node.references.transformed import PlanarTransform, TransformedReference
from msgs_config.character.layout import JointLayout
from msgs_config.character.model import Character
from msgs_config.clips.reading import ClipFrames, read_clip
from msgs_config.errors import ActuatedCharactersError, MotionError
from msgs_config.parameters import Values
from msgs_config.shared_parameters import SharedSettings


@dataclass(frozen=True)
class _Move:
    """A motion from a time on, with what is left of the difference from the one before."""

    start: float  # s
    motion: Reference
    offset: InertializationOffset | None = None


class GroundTrack:
    """Motions one after another; each begins as the one before moves, and comes to its own."""

    def __init__(self, layout: JointLayout, first: Reference) -> None:
        self._layout = layout
        self._moves = [_Move(0.0, first)]

    def sample(self, time: float) -> ReferenceState:
        """The desired state `time` seconds after the episode's first state."""
        row = bisect_right(self._moves, time, key=lambda move: move.start) - 1
        move = self._moves[max(row, 0)]
        state = move.motion.sample(time)
        return state if move.offset is None else move.offset.applied(state, time)

    def go_over(self, motion: Reference, start: float, blend: float) -> None:
        """Go over to a motion at a time, after all those before, within a time; both in s."""
        offset = None
        if start > 0.0 and blend > 0.0:
            there, wanted = motion.sample(start), self.sample(start)
            offset = InertializationOffset(self._layout, there, wanted, start, blend)
        self._moves.append(_Move(start, motion, offset))


class _Still:
    """A state's pose, forever."""

    def __init__(self, state: ReferenceState) -> None:
        still = state.velocity * 0.0
        self._state = ReferenceState(state.configuration, still, still)

    def sample(self, time: float) -> ReferenceState:
        return self._state


class GroundMaker:
    """Makes the track of a timeline's clips and steering.

    `end` is when all of it is over, s; `still`, when it stands after that.
    """

    def __init__(self, character: Character, values: Values, timeline: Timeline) -> None:
        self._character, self._values, self._timeline = character, values, timeline
        self._rate = SharedSettings.of(values).rate
        self._track = GroundTrack(character.layout, HoldReference(character))
        self.end = self.still = 0.0
        self.clamped = list[str]()  # degrees of freedom that had to be kept within their limits

    def make(self) -> GroundTrack:
        """The track. Raises MotionError if the character cannot do it."""
        entries: list[ClipEntry | Sequence[SteeringEntry]] = [
            *self._timeline.clips,
            *_groups(self._timeline.steering),
        ]
        entries.sort(key=_start)
        begins = [*map(_start, entries), None]
        for entry, then in zip(entries, begins[1:], strict=True):
            if isinstance(entry, ClipEntry):
                self._add_clip(entry, then)
            else:
                self._add_steering(entry, then)
        return self._track

    def _add_clip(self, entry: ClipEntry, then: float | None) -> None:
        """A part of a clip, until it is over or something else begins."""
        frames = self._frames(entry)
        length = float(frames.times[-1])
        if entry.begin >= length and not frames.wraps:
            raise MotionError(
                f"{entry.place}: from is {entry.begin:g} s; clip '{entry.clip}' lasts {length:g} s"
            )
        end = entry.end if frames.wraps else min(entry.end or length, length)
        motion = ClipReference(self._character.layout, frames)
        carry = self._carry(motion.sample(entry.begin), entry)
        moved = TransformedReference(self._character.layout, motion, carry, entry.at, entry.begin)
        self._track.go_over(moved, entry.at, entry.blend)
        over = entry.at if end is None else entry.at + end - entry.begin
        if end is not None and (then is None or over < then):
            still = moved.sample(over - 0.5 / self._rate)  # of one that ends: before it is at rest
            self._track.go_over(_Still(still), over, max(entry.blend, 1.0 / self._rate))
        self.end = max(self.end, over)

    def _frames(self, entry: ClipEntry) -> ClipFrames:
        beside = self._timeline.file.parent / entry.clip
        name = str(beside) if beside.is_file() else entry.clip
        try:
            frames = read_clip(self._character, name)
        except ActuatedCharactersError as error:
            raise MotionError(f"{entry.place}: {error}") from error
        self.clamped += frames.clamped
        return frames

    def _carry(self, first: ReferenceState, entry: ClipEntry) -> PlanarTransform:
        """The move of a clip's beginning to where it is to be."""
        if not self._character.layout.has_floating_base:
            if entry.position is not None or entry.heading is not None:
                raise MotionError(f"{entry.place}: '{self._character.name}' is fixed to the world")
            return PlanarTransform()
        posture, here = Posture(self._character), self._track.sample(entry.at).configuration
        place, heading = here.position[:3].copy(), float(posture.heading(here.orientations_xyzw[0]))
        if entry.position is not None:
            place[:2] = entry.position
        if entry.heading is not None:
            heading = entry.heading
        begin = first.configuration
        faces = float(posture.heading(begin.orientations_xyzw[0]))
        return PlanarTransform.leading(begin.position[:3], faces, place, heading)

    def _add_steering(self, group: Sequence[SteeringEntry], then: float | None) -> None:
        """Velocities, each from when the one before is over; after the last one it stops."""
        first, start = group[0], round(group[0].at * self._rate) / self._rate
        try:
            steered = REFERENCES["steered"](self._character, self._values).reference
        except ActuatedCharactersError as error:
            raise MotionError(f"{first.place}: {error}") from error
        assert isinstance(steered, SteeredReference)
        for command in self._commands(group, steered, start):
            steered = steered.steered(command, 0).reference
        here, posture = self._track.sample(start).configuration, Posture(self._character)
        carry = posture.carry(steered.sample(0.0).configuration, here)
        moved = TransformedReference(self._character.layout, steered, carry, start)
        self._track.go_over(moved, start, first.blend)
        self.end = max(self.end, group[-1].until)
        if then is None:  # nothing cuts off how it comes to stand
            stops = round((group[-1].until - start) * self._rate)
            self.still = start + steered.standing_from(stops) / self._rate

    def _commands(
        self, group: Sequence[SteeringEntry], steered: SteeredReference, start: float
    ) -> list[VelocityCommand]:
        """The commands of a group, repeated so that they do not time out, and one that stops."""
        commands: list[VelocityCommand] = []
        for entry in group:
            tick = round((entry.at - start) * self._rate)
            end = round((entry.until - start) * self._rate)
            command = VelocityCommand(tick, *entry.velocity)
            if steered.limits.clamped(command) != command:
                most = steered.limits.clamped(command)
                raise MotionError(
                    f"{entry.place}: velocity is more than it can, which is at most "
                    f"[{most.forward:g}, {most.left:g}, {most.turn:g}] "
                    "(see controller_node.steering.*)"
                )
            commands += [replace(command, tick=t) for t in range(tick, end, steered.repeat_ticks)]
        return [*commands, VelocityCommand(round((group[-1].until - start) * self._rate), 0.0)]


def _groups(entries: Sequence[SteeringEntry]) -> list[Sequence[SteeringEntry]]:
    """Velocities of which each goes on from the one before."""
    groups: list[list[SteeringEntry]] = []
    for entry in entries:
        if groups and entry.at == groups[-1][-1].until:
            groups[-1].append(entry)
        else:
            groups.append([entry])
    return list(groups)


def _start(entry: ClipEntry | Sequence[SteeringEntry]) -> float:
    return entry.at if isinstance(entry, ClipEntry) else entry[0].at
