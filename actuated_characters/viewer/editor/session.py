"""A timeline that is being made: the document, the time, and the pose that the character has.

Whoever runs what was made needs nothing of this but the document's file, which always has the
newest state.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from actuated_characters.timeline import edits
from actuated_characters.timeline.content import KEYS, RATES, TRACKS, is_number
from actuated_characters.timeline.document import Document
from actuated_characters.timeline.edits import SHORTEST_TIME, Edit
from actuated_characters.timeline.poses import (
    joints_of,
    mirrored,
    mirrored_rate,
    mirrored_values,
    values_of,
    whole_poses,
)
from actuated_characters.timeline.preview import Preview
from actuated_characters.viewer.recorded.timeline import Playback
from controller_node.references.posing import Posing
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.character.model import Character
from msgs_config.errors import MotionError

_RATE = 50.0  # Hz of the times at which keys can be set, beside those of the file
_LENGTHS, _ROOM = 5.0, 1.0  # s: the time line is so long, or a multiple; after what is last
_SAME = 1e-6  # rad or m by which a joint has not moved


class Session:
    """A document at a time; its methods are for one thread."""

    def __init__(self, character: Character, document: Document) -> None:
        self.character, self.document = character, document
        self.posing = Posing(character)
        self.playback = Playback(np.zeros(1))
        self.layer = 0
        self.writes_all = True
        """Whether a new key has all joints, or those that the layer has and those that moved."""
        self.version = 0
        """Another one after each change of the document."""
        self.poses_by_hand = 0
        """Another one after each pose by hand."""
        self.seen: Callable[[float], FloatArray | None] = lambda time: None
        """What is seen in the place of keys at a time in s, such as a take; (n,) message form."""
        self._copied: tuple[dict[str, float], list[dict[str, float]]] | None = None
        self._longest = _LENGTHS  # s that the time line was long
        self._posed: tuple[float, GeneralizedPosition] | None = None  # and the time of that
        self.preview = Preview(character, document.file)
        self._take_content()

    def _take_content(self) -> None:
        """Have all else fit the document."""
        self.version += 1
        content = self.document.content
        self.layer = min(self.layer, max(len(content.get(KEYS, [])) - 1, 0))
        self.preview.take(content)
        self.playback.times = self._times()
        self.playback.seek(self.playback.time)

    def _times(self) -> FloatArray:
        """The times (t,), s, at which the time line can stand."""
        content = self.document.content
        marked = {
            rounded
            for name in TRACKS
            for event in content.get(name, [])
            for rounded in (event["at"], event.get("until"))
            if is_number(rounded)
        }
        marked |= {pose["at"] for layer in content.get(KEYS, []) for pose in layer["poses"]}
        given = content.get("duration")
        over = max([self.preview.end, *marked])
        last = given if is_number(given) else self._length(over)
        grid = np.arange(int(last * _RATE + SHORTEST_TIME) + 1) / _RATE
        wanted = np.array(sorted(each for each in marked if 0.0 <= each <= last))
        gaps = np.abs(grid[:, np.newaxis] - wanted) if len(wanted) else np.ones((len(grid), 1))
        times: FloatArray = np.unique(np.append(grid[gaps.min(axis=1) > SHORTEST_TIME], wanted))
        return times if len(times) else np.zeros(1)

    def _length(self, last: float) -> float:
        """How long the time line is, s, with what is last: so that it is seldom another length."""
        wanted = _LENGTHS * math.ceil((last + _ROOM) / _LENGTHS - SHORTEST_TIME)
        self._longest = max(self._longest, wanted)
        return self._longest

    @property
    def time(self) -> float:
        """The present time, s."""
        return self.playback.time

    @property
    def poses(self) -> list[Mapping[str, Any]]:
        """The poses of the present layer."""
        layers = self.document.content.get(KEYS, [])
        poses: list[Mapping[str, Any]] = layers[self.layer]["poses"] if layers else []
        return poses

    @property
    def key(self) -> int | None:
        """The number of the present layer's pose at the present time; None: there is none."""
        near = [
            number
            for number, pose in enumerate(self.poses)
            if abs(pose["at"] - self.time) < SHORTEST_TIME
        ]
        return near[0] if near else None

    @property
    def pose(self) -> GeneralizedPosition:
        """The pose that is seen.

        That of `seen`, or of a hand until the time is another one, or of the keys.
        """
        if (position := self.seen(self.time)) is not None:
            return self.character.layout.configuration(position)
        if self._posed is not None and self._posed[0] == self.time:
            return self._posed[1]
        return self.preview.at(self.time)

    @property
    def is_posed(self) -> bool:
        """Whether the pose that is seen is none of the keys."""
        return self._posed is not None and self._posed[0] == self.time

    def take_pose(self, pose: GeneralizedPosition) -> None:
        """Have a pose by hand at the present time; the time stands."""
        self.playback.plays = False
        self._posed = (self.time, pose)
        self.poses_by_hand += 1

    def edit(self, edit: Edit) -> bool:
        """Edit the document; whether anything is another now. Raises as `Document.apply`."""
        return self._changed(self.document.apply(edit))

    def undo(self) -> bool:
        """Undo the last edit; whether there was one. Raises as `Document.undo`."""
        return self._changed(self.document.undo())

    def redo(self) -> bool:
        """Do again what was undone; whether there was anything. Raises as `Document.redo`."""
        return self._changed(self.document.redo())

    def read_again(self) -> bool:
        """Take over the file as another program has left it. Raises as `Document.read_again`."""
        return self._changed(self.document.read_again())

    def _changed(self, is_other: bool) -> bool:
        if is_other:
            self._posed = None
            self._take_content()
        return is_other

    def set_key(self) -> None:
        """Have the pose that is seen as a key of the present layer at the present time."""
        pose = self.pose
        joints = set(self.character.layout.joint_names)
        if not self.writes_all:
            joints = {
                name for each in self.poses for name in joints_of(self.character, each["pose"])
            }
            joints |= self._moved_joints(pose)
        if not joints:
            raise MotionError("no joint has moved; drag one, or let a key have all joints")
        values = values_of(self.character, pose, joints)
        self.edit(edits.add_pose(self.layer, self.time, values))
        self._posed = None

    def _moved_joints(self, pose: GeneralizedPosition) -> set[str]:
        layout = self.character.layout
        before = self.preview.at(self.time)
        moved = np.abs(layout.difference(before, pose)) > _SAME
        return {joint.name for joint in layout.joints if moved[joint.entries].any()}

    def _present_key(self) -> int:
        number = self.key
        if number is None:
            raise MotionError(f"layer {self.layer + 1} has no key at {self.time:g} s")
        return number

    def delete_key(self) -> None:
        """Delete the key at the present time. Raises MotionError if there is none."""
        self.edit(edits.delete_pose(self.layer, self._present_key()))

    def move_key(self, to: float) -> None:
        """Move the key at the present time to another one, s, and go there."""
        self.edit(edits.move_pose(self.layer, self._present_key(), to))
        self.playback.seek(to)

    def set_ease(self, ease: str) -> None:
        """Set how the key at the present time is moved through."""
        self.edit(edits.set_ease(self.layer, self._present_key(), ease))

    def mirror(self) -> None:
        """Mirror the key at the present time; or the pose of a hand, or between keys, as a pose.

        Raises:
            ClipError: the character is not its own image.
        """
        number = self.key
        if number is None or self.is_posed:
            self.take_pose(mirrored(self.character, self.pose))
            return
        values = mirrored_values(self.character, self.poses, number)
        rates = (mirrored_rate(self.character, each) for each in self._rates(number))
        self.edit(edits.set_pose(self.layer, number, values, *rates))

    def _rates(self, number: int) -> list[dict[str, float]]:
        """The velocity and the acceleration of a key of the present layer, empty if none."""
        return [self.poses[number].get(name) or {} for name in RATES]

    def copy(self) -> None:
        """Remember the key at the present time, or the pose that is seen, for `paste`."""
        number, joints = self.key, self.character.layout.joint_names
        pose, rates = self.pose, [dict[str, float]() for _ in RATES]
        if number is not None and not self.is_posed:
            rates = self._rates(number)
            joints = joints_of(self.character, self.poses[number]["pose"])
            pose = whole_poses(self.character, self.poses)[number]
        self._copied = values_of(self.character, pose, joints), rates

    def paste(self) -> None:
        """Have what was copied as a key at the present time. Raises MotionError if nothing was."""
        if self._copied is None:
            raise MotionError("nothing was copied; copy a key first")
        values, (velocity, acceleration) = self._copied
        added = edits.add_pose(self.layer, self.time, values, None, velocity, acceleration)
        self.edit(added)

    def add_layer(self, name: str) -> None:
        """Add a layer above all others, and be in it."""
        self.edit(edits.add_layer(name))
        self.layer = len(self.document.content[KEYS]) - 1
        self.version += 1

    def go_to_key(self, steps: int) -> None:
        """Go to the next key of the present layer, or with -1 to the one before."""
        times = [float(pose["at"]) for pose in self.poses]
        later = [at for at in times if (at - self.time) * steps > SHORTEST_TIME]
        if later:
            self.playback.plays = False
            self.playback.seek(min(later, key=lambda at: abs(at - self.time)))
