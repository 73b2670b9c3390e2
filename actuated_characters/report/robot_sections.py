"""The sections of a report on a bag of any robot: what its joint states say, and no more."""

from collections.abc import Callable

import numpy as np

from actuated_characters.bags.robots.reading import RobotRecording
from actuated_characters.report import charts
from actuated_characters.report.events import Event
from actuated_characters.report.page import NOT_KNOWN, Section, Table
from actuated_characters.report.sections import CharacterReport

POSITIONS = "positions"
"""Name of a picture beside those of a run."""

_COLUMNS = ("joint", "unit", "least", "mean", "largest", "lower limit", "upper limit")


class RobotReport(CharacterReport):
    """Makes the sections of a bag of a robot, which has no ticks, references or contacts."""

    _recording: RobotRecording

    @property
    def makers(self) -> list[Callable[[], Section]]:
        """Functions that make the sections, in their order."""
        return [self._result, self._positions, self._efforts]

    def _measured_events(self) -> list[Event]:
        return []

    def _tiles(self) -> list[tuple[str, str]]:
        return []

    def _verdict(self) -> str:
        recording, span = self._recording, float(self._recording.times[-1])
        count = len(recording.stamps_ns)
        rate = f", {(count - 1) / span:.4g} a second" if span > 0.0 else ""
        return f"{count} states of '{recording.topic}' over {span:.4g} s{rate}."

    def _positions(self) -> Section:
        recording, rows, panels = self._recording, [], []
        joints = {link.joint.name: link.joint for link in recording.character.links}
        for name in recording.layout.actuated_joint_names:
            joint = recording.layout.joint(name)
            values, limits = recording.position[:, joint.entries], joints[name]
            unit = "m" if joint.type.value == "prismatic" else "rad"
            for dof, series in zip(joint.dof_names, values.T, strict=True):
                numbers = (series.min(), series.mean(), series.max(), limits.lower, limits.upper)
                shown = (f"{x:.4g}" if np.isfinite(x) else NOT_KNOWN for x in map(float, numbers))
                rows.append((dof, unit, *shown))
            lines = dict(zip(joint.dof_names, values.T, strict=True))
            panels.append(charts.Panel(f"position ({unit})", lines, name))
        if not rows:
            return Section("positions", remarks=["The robot has no joints that move."])
        table = Table(rows, _COLUMNS, "positions, and the limits of the joints")
        figure = charts.series_chart(self._timeline, panels)
        picture = self._drawn(figure, POSITIONS, "positions of the joints over time")
        return Section("positions", [picture], [table])
