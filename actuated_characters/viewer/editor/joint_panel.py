"""The numbers of one joint in the panel: of a hinge one, of a ball joint its rotation vector."""

from collections.abc import Callable
from functools import partial
from typing import Any

import viser

from actuated_characters.viewer.controls.actions import ActionQueue
from actuated_characters.viewer.editor.session import Session
from actuated_characters.viewer.recorded.playback_controls import on
from controller_node.references.limits import LARGEST_NUMBER, JointLimits

_MOST_ENTRIES = 6  # of a joint: the floating base
_DECIMALS = 4


class JointFields:
    """A menu of joints, and the numbers of the one that is chosen, in the pose that is seen."""

    def __init__(
        self,
        gui: viser.GuiApi,
        session: Session,
        act: Callable[[Callable[[], object]], None],
        actions: ActionQueue,
    ) -> None:
        """`act` does something, and says what was wrong with it."""
        self._session, self._act = session, act
        self._limits = JointLimits(session.character)
        self._shown: tuple[str, list[float]] | None = None
        layout = session.character.layout
        self._joint: Any = gui.add_dropdown("Joint", tuple(layout.joint_names))
        self._fields: list[Any] = [
            gui.add_number(f"{row}", 0.0, step=0.01) for row in range(_MOST_ENTRIES)
        ]
        for row, field in enumerate(self._fields):
            on(actions, field, partial(self._set, row))
        on(actions, self._joint, lambda _: self.show())

    def _set(self, row: int, value: float) -> None:
        self._act(partial(self._move, row, value))

    def _move(self, row: int, value: float) -> None:
        """Have one entry of the joint elsewhere, within its limits."""
        layout, pose = self._session.character.layout, self._session.pose
        entry = layout.joint(str(self._joint.value)).start + row
        position = pose.position.copy()
        lower, upper = self._limits.lower[entry], self._limits.upper[entry]
        position[entry] = min(max(float(value), lower), upper)
        self._session.take_pose(layout.configuration(position))

    def show(self) -> None:
        """Show the joint as it is in the pose that is seen."""
        joint = self._session.character.layout.joint(str(self._joint.value))
        values = self._session.pose.position[joint.entries].tolist()
        if (joint.name, values) == self._shown:
            return
        self._shown = (joint.name, values)
        for row, field in enumerate(self._fields):
            field.visible = row < len(values)
            if row < len(values):
                entry = joint.start + row
                field.label = f"{joint.dof_names[row]} ({self._limits.unit(entry)})"
                field.min = max(float(self._limits.lower[entry]), -LARGEST_NUMBER)
                field.max = min(float(self._limits.upper[entry]), LARGEST_NUMBER)
                field.value = round(min(max(values[row], field.min), field.max), _DECIMALS)
