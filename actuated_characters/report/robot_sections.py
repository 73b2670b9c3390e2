"""The sections of a report on a bag of any robot: what its joint states say, and no more."""

from collections.abc import Callable

import numpy as np

from actuated_characters.bags.robots.reading import RobotRecording
from actuated_characters.report import charts
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
        root = [self._root] if self._recording.layout.has_floating_base else []
        return [self._result, self._positions, *root, self._efforts, self._ticks, self._run]

    def _measured(self) -> dict[str, object]:
        recording = self._recording
        return {
            "states": len(recording.stamps_ns),
            "sim_time_s": float(recording.times[-1]),
            "degrees_of_freedom": recording.layout.size,
            "fell": None,
        }

    def _result(self) -> Section:
        recording = self._recording
        pictures, remarks = self._strip()
        sentence = (
            f"{len(recording.stamps_ns)} states of '{recording.topic}' over "
            f"{recording.times[-1]:.4g} s."
        )
        return Section("", pictures, remarks=[*recording.remarks, *remarks], verdict=sentence)

    def _positions(self) -> Section:
        recording, rows, panels = self._recording, [], []
        joints = {link.joint.name: link.joint for link in recording.character.links}
        actuated = recording.layout.actuated_joint_names
        for name in actuated:
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
        picture = self._series(POSITIONS, "positions of the joints over time", panels, columns=3)
        return Section("positions", [picture], [table])

    def _run(self) -> Section:
        recording = self._recording
        span = float(recording.times[-1])
        rate = f"{(len(recording.times) - 1) / span:.4g} Hz" if span > 0.0 else NOT_KNOWN
        facts = [
            ("character", recording.character.name),
            ("degrees of freedom", str(recording.layout.size)),
            ("mass", f"{recording.character.mass:.4g} kg"),
            ("states", str(len(recording.times))),
            ("mean rate", rate),
        ]
        return Section("robot", tables=[Table(facts)])
