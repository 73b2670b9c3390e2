"""A trace of a trainer: observations that it has logged, and the states that they belong to.

A row is a decision. It is an archive of numpy (`.npz`) of arrays (t, s), or a table (`.csv`) whose
columns are `KEY_0`, `KEY_1`, ...; joints are in the policy's order.
"""

import csv
import io
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from controller_node.behaviours.onnx_policy.description import Description, UsedTerm
from controller_node.behaviours.onnx_policy.motion import Pose, TrackedMotion
from controller_node.behaviours.onnx_policy.terms import Situation
from msgs_config import files
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.geometry import rotations

OBSERVATION = "obs"
_NOWHERE = Pose(np.zeros(3), np.array((0.0, 0.0, 0.0, 1.0)))
_ROTATION, _SPIN = "root_quat", "root_ang_vel"
_SIZES = {  # of a row; 0: one a joint, -1: any
    OBSERVATION: -1,
    "time": 1,
    "root_pos": 3,
    "root_quat_xyzw": 4,
    "root_quat_wxyz": 4,
    "root_lin_vel_w": 3,
    "root_ang_vel_w": 3,
    "root_ang_vel_b": 3,
    "joint_pos": 0,
    "joint_vel": 0,
    "last_action": 0,
    "command": 3,
    "motion_joint_pos": 0,
    "motion_joint_vel": 0,
}
_NEEDED: Mapping[str, tuple[str, ...]] = {  # by a term what it is made of, as keys begin
    "base_lin_vel": ("root_lin_vel_w", _ROTATION),
    "base_ang_vel": (_SPIN, _ROTATION),
    "projected_gravity": (_ROTATION,),
    "base_quat": (_ROTATION,),
    "base_height": ("root_pos",),
    "velocity_commands": ("command",),
    "gait_phase": (),
    "joint_pos_rel": ("joint_pos",),
    "joint_pos_abs": ("joint_pos",),
    "joint_vel_rel": ("joint_vel",),
    "last_action": ("last_action",),
    "motion_joint_pos": ("motion_joint_pos",),
    "motion_joint_vel": ("motion_joint_vel",),
    "motion_anchor_pos_b": ("anchors",),  # no trace has these
    "motion_anchor_ori_b": ("anchors",),
    "motion_command": ("motion_joint_pos", "motion_joint_vel"),
}


@dataclass(frozen=True)
class Trace:
    """Arrays (t, s) by key."""

    arrays: Mapping[str, FloatArray]

    @property
    def observations(self) -> FloatArray:
        """Those of the trainer (t, o)."""
        return self.arrays[OBSERVATION]

    def missing(self, used: UsedTerm) -> str:
        """The first key that a term is made of and the trace has not; empty: it has all."""
        for need in _NEEDED[used.term.name]:
            if not any(key.startswith(need) for key in self.arrays):
                return need
        return ""

    def turns(self) -> FloatArray:
        """Orientations xyzw (t, 4) of the base in the world; none where the trace has none."""
        if "root_quat_wxyz" in self.arrays:
            return rotations.xyzw_from_wxyz(self.arrays["root_quat_wxyz"])
        still = np.tile((0.0, 0.0, 0.0, 1.0), (len(self.observations), 1))
        return self.arrays.get("root_quat_xyzw", still)

    def situations(self, policy: Description, size: int, entries: IntArray) -> list[Situation]:
        """What the terms of each row are computed of, of a character with so many entries."""
        rows, turns = range(len(self.observations)), self.turns()
        position, velocity = np.zeros((len(rows), size)), np.zeros((len(rows), size))
        if any(used.term.needs_base for used in policy.terms):
            position[:, :3] = self._get("root_pos", 3)
            position[:, 3:6] = rotations.log(turns)
            velocity[:, :3] = self._get("root_lin_vel_w", 3)
            spin = rotations.rotate(rotations.conjugate(turns), self._get("root_ang_vel_w", 3))
            velocity[:, 3:6] = self.arrays.get("root_ang_vel_b", spin)
        position[:, entries] = self._get("joint_pos", len(entries))
        velocity[:, entries] = self._get("joint_vel", len(entries))
        wanted = self._get("motion_joint_pos", len(entries))
        wanted_velocity = self._get("motion_joint_vel", len(entries))
        actions, commands = self._get("last_action", len(entries)), self._get("command", 3)
        times = self.arrays.get("time", policy.step_s * np.arange(len(rows))[:, np.newaxis])
        return [
            Situation(
                time=float(times[row, 0]),
                position=position[row],
                velocity=velocity[row],
                entries=entries,
                default=policy.default,
                last_action=actions[row],
                command=tuple(commands[row].tolist()),
                motion=TrackedMotion(wanted[row], wanted_velocity[row], _NOWHERE),
                anchor=_NOWHERE,
            )
            for row in rows
        ]

    def _get(self, key: str, size: int) -> FloatArray:
        """An array, or zeros, which only a term that is not compared is made of."""
        return self.arrays.get(key, np.zeros((len(self.observations), size)))


def read_trace(path: Path, policy: Description) -> Trace:
    """Read a trace of a policy. Raises ConfigurationError: it is malformed; names file and key."""
    content = _read_table(path) if path.suffix == ".csv" else _read_archive(path)
    if OBSERVATION not in content:
        raise ConfigurationError(f"{path}: it has no '{OBSERVATION}', the trainer's observations")
    arrays = {}
    rows = len(content[OBSERVATION])
    for key, array in content.items():
        if key not in _SIZES:
            raise ConfigurationError(f"{path}: {one_of('key', key, list(_SIZES))}")
        size = {0: len(policy.joints), -1: policy.size}.get(_SIZES[key], _SIZES[key])
        shaped = array.reshape(rows, -1) if array.size == rows * size else array
        if shaped.shape != (rows, size) or not rows:
            raise ConfigurationError(
                f"{path}: '{key}' has the shape {array.shape}; it must be ({rows}, {size})"
            )
        if not np.isfinite(shaped).all():
            raise ConfigurationError(f"{path}: '{key}' has entries that are not finite")
        arrays[key] = shaped.astype(float)
    return Trace(arrays)


def _read_archive(path: Path) -> dict[str, Any]:
    try:
        with np.load(path, allow_pickle=False) as archive:
            content = {key: archive[key] for key in archive.files}
    except OSError as error:
        raise ConfigurationError(f"{path}: {error.strerror or error}") from error
    except Exception as error:  # numpy raises anything for what is no archive
        raise ConfigurationError(f"{path} is no archive of numpy (.npz)") from error
    for key, array in content.items():
        if array.dtype.kind not in "iuf" or not array.ndim:
            raise ConfigurationError(f"{path}: '{key}' is no array of numbers")
    return content


def _read_table(path: Path) -> dict[str, Any]:
    rows = list(csv.reader(io.StringIO(files.read_text(path, ConfigurationError))))
    head, body = (rows[0], rows[1:]) if rows else ([], [])
    columns: dict[str, list[int]] = {}
    for number, name in enumerate(head):
        found = re.fullmatch(r"(\w+?)(?:_(\d+))?", name.strip())
        key = found[1] if found else name
        if found is None or int(found[2] or 0) != len(columns.setdefault(key, [])):
            raise ConfigurationError(f"{path}: column '{name}' must be named KEY_0, KEY_1, ...")
        columns[key].append(number)
    try:
        table = np.array([[float(cell) for cell in row] for row in body])
        return {key: table[:, numbers] for key, numbers in columns.items()}
    except (ValueError, IndexError) as error:
        raise ConfigurationError(f"{path}: its rows must have a number in each column") from error
