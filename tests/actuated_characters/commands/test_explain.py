"""`explain`: entries by name, and what a trace has otherwise, against traces made by numpy."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from actuated_characters.cli import main
from tests.support.networks import (
    QUADRUPED,
    QUADRUPED_JOINTS,
    QUADRUPED_SIZE,
    Mlp,
    describe,
    quadruped,
)
from tests.support.rotation_matrices import matrices

ROWS = 12
TERMS = {
    "base_lin_vel": {"scale": 2.0},
    **QUADRUPED["observations"],
    "base_quat": {"quaternion": "wxyz"},
}
SIZE = QUADRUPED_SIZE + 7
LIN, ANG, GRAVITY, COMMAND = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12)
POSITIONS, VELOCITIES, ACTIONS, QUAT = slice(12, 24), slice(24, 36), slice(36, 48), slice(48, 52)


def trace() -> dict[str, Any]:
    """Random states, and the observations that a trainer makes of them."""
    rng = np.random.default_rng(5)
    quats = rng.normal(size=(ROWS, 4))
    quats[:, 3] = np.abs(quats[:, 3])
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    arrays = {
        "root_quat_xyzw": quats,
        "root_lin_vel_w": rng.normal(size=(ROWS, 3)),
        "root_ang_vel_b": rng.normal(size=(ROWS, 3)),
        "joint_pos": rng.normal(size=(ROWS, 12)),
        "joint_vel": rng.normal(size=(ROWS, 12)),
        "last_action": rng.normal(size=(ROWS, 12)),
        "command": rng.normal(size=(ROWS, 3)),
    }
    into = np.swapaxes(matrices(quats), -1, -2)
    arrays["obs"] = np.concatenate(
        (
            2.0 * np.einsum("rij,rj->ri", into, arrays["root_lin_vel_w"]),
            0.25 * arrays["root_ang_vel_b"],
            into @ (0.0, 0.0, -1.0),
            arrays["command"] * (2.0, 2.0, 0.25),
            arrays["joint_pos"] - QUADRUPED["default_joint_pos"],
            0.05 * np.clip(arrays["joint_vel"], -4.0, 4.0),
            arrays["last_action"],
            quats[:, [3, 0, 1, 2]],
        ),
        axis=1,
    )
    return arrays


def sign(arrays: dict[str, Any]) -> None:
    arrays["obs"][:, GRAVITY] *= -1.0


def factor(arrays: dict[str, Any]) -> None:
    arrays["obs"][:, ANG] *= 4.0


def quaternion(arrays: dict[str, Any]) -> None:
    arrays["obs"][:, QUAT] = arrays["obs"][:, QUAT][:, [1, 2, 3, 0]]


def order(arrays: dict[str, Any]) -> None:
    legs_first = [part * 4 + leg for leg in range(4) for part in range(3)]
    arrays["obs"][:, POSITIONS] = arrays["obs"][:, POSITIONS][:, legs_first]


def two_signs(arrays: dict[str, Any]) -> None:
    arrays["obs"][:, POSITIONS][:, [0, 2]] *= -1.0


def world(arrays: dict[str, Any]) -> None:
    arrays["obs"][:, LIN] = 2.0 * arrays["root_lin_vel_w"]


def pose(arrays: dict[str, Any]) -> None:
    arrays["obs"][:, POSITIONS] = arrays["joint_pos"]


def late(arrays: dict[str, Any]) -> None:
    arrays["obs"][1:, ACTIONS] = arrays["obs"][:-1, ACTIONS].copy()


def zeros(arrays: dict[str, Any]) -> None:
    arrays["obs"][:, COMMAND] = 0.0


def nonsense(arrays: dict[str, Any]) -> None:
    arrays["obs"][:, ANG] = np.sin(5.0 * arrays["obs"][:, ANG])


MADE_WRONG: list[tuple[Callable[[dict[str, Any]], None], str]] = [
    (sign, "entry 6 differs first: projected_gravity, x; in row 0 the trace has .*: the sign$"),
    (
        factor,
        "entry 3 differs first: base_ang_vel, x; .*: the scale: the trace has 4 times as much",
    ),
    (quaternion, "entry 48 .*: the order of the quaternion: the trace has xyzw, here it is wxyz"),
    (
        order,
        f"entry 13 .*: the order: the trace has '{QUADRUPED_JOINTS[4]}' where "
        f"'{QUADRUPED_JOINTS[1]}' is here",
    ),
    (
        two_signs,
        f"entry 12 .*: the sign of {QUADRUPED_JOINTS[0]}, {QUADRUPED_JOINTS[2]}$",
    ),
    (world, "entry 0 .*: the frame: the trace has it in the world's axes"),
    (pose, "entry 16 .*: an offset, the same in all rows, as of another default pose"),
    (late, "entry 36 .*: the time: the trace has what is 1 decision before"),
    (zeros, "entry 9 .*: the trace has zeros"),
    (nonsense, r"entry 3 differs first: base_ang_vel, x; in row 0 .*here it is -?[\d.]+$"),
]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    file = Mlp(SIZE, 12).write(tmp_path / "policy.onnx")
    describe(file, quadruped(observations=TERMS))
    return file


def explain(file: Path, *options: str) -> int:
    return main(["explain", str(file), "--character", "laikago", *options])


def compared(file: Path, arrays: dict[str, Any]) -> int:
    np.savez(file.with_name("trace.npz"), **arrays)
    return explain(file, "--trace", str(file.with_name("trace.npz")))


def test_the_entries_are_listed(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert explain(file) == 0
    title, head, *rows = capsys.readouterr().out.splitlines()
    assert title == "policy.onnx: 52 entries every 0.02 s"
    assert re.split(r"\s{2,}", head) == ["entry", "term", "of", "scale", "unit", "frame"]
    cells = [re.split(r"\s{2,}", row) for row in rows]
    assert [each[0] for each in cells] == [str(row) for row in range(SIZE)]
    assert cells[9] == ["9", "velocity_commands", "ahead", "2", "m/s, m/s, rad/s", "heading"]
    assert cells[16] == ["16", "joint_pos_rel", QUADRUPED_JOINTS[4], "1", "rad or m", "-"]


def test_a_trace_that_agrees(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert compared(file, trace()) == 0
    assert capsys.readouterr().out == "trace.npz: all compared entries of 12 rows agree\n"


@pytest.mark.parametrize(("spoil", "said"), MADE_WRONG)
def test_the_first_entry_that_differs_is_named_and_why(
    spoil: Callable[[dict[str, Any]], None],
    said: str,
    file: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    arrays = trace()
    spoil(arrays)
    assert compared(file, arrays) == 1
    (line,) = capsys.readouterr().out.splitlines()
    assert re.search(said, line), line


def test_other_terms_that_differ_are_named(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arrays = trace()
    factor(arrays)
    zeros(arrays)
    assert compared(file, arrays) == 1
    assert capsys.readouterr().out.endswith("\nothers that differ: velocity_commands\n")


def test_what_a_trace_lacks_is_not_compared(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arrays = trace()
    zeros(arrays)
    del arrays["command"]
    assert compared(file, arrays) == 0
    first, last = capsys.readouterr().out.splitlines()
    assert first == "not compared: velocity_commands, for the trace has no 'command'"
    assert last.endswith("agree")


def test_a_table_is_read_as_an_archive_is(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arrays = trace()
    arrays["obs"] = arrays["obs"].astype(np.float32)
    names = [f"{key}_{row}" for key, each in arrays.items() for row in range(each.shape[1])]
    table = file.with_name("trace.csv")
    content = np.concatenate(list(arrays.values()), axis=1)
    np.savetxt(table, content, delimiter=",", header=",".join(names), comments="")
    assert explain(file, "--trace", str(table)) == 0


def test_a_history_in_the_other_order_is_seen(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = Mlp(36, 12).write(tmp_path / "policy.onnx")
    describe(file, quadruped(observations={"joint_pos_abs": {"history_length": 3}}))
    joints = np.random.default_rng(1).normal(size=(ROWS, 12))
    padded = np.concatenate((joints[:1], joints[:1], joints))
    oldest_first = [padded[row : row + 3] for row in range(ROWS)]
    assert compared(file, {"joint_pos": joints, "obs": np.array(oldest_first)}) == 0
    newest_first = [each[::-1] for each in oldest_first]
    assert compared(file, {"joint_pos": joints, "obs": np.array(newest_first)}) == 1
    line = capsys.readouterr().out.splitlines()[-1]
    assert line.startswith("entry 0 differs first: joint_pos_abs, ") and "2 decisions ago" in line
    assert line.endswith("the time: the trace has what is 2 decisions later")


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"obs": np.zeros((ROWS, 51))}, "'obs' has the shape (12, 51); it must be (12, 52)"),
        ({"joint_positions": np.zeros((ROWS, 12))}, "unknown key 'joint_positions'; did you mean"),
        ({"command": np.full((ROWS, 3), np.nan)}, "'command' has entries that are not finite"),
        ({"command": np.array(["a"] * ROWS)}, "'command' is no array of numbers"),
    ],
)
def test_a_malformed_trace_is_one_line(
    changed: dict[str, Any], said: str, file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert compared(file, trace() | changed) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ") and said in line


@pytest.mark.parametrize("name", ["trace.npz", "trace.csv", "nowhere.npz"])
def test_what_is_no_trace_is_one_line(
    name: str, file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if name.startswith("trace"):
        file.with_name(name).write_text("what, is, this?\n1, 2\n")
    assert explain(file, "--trace", str(file.with_name(name))) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ") and name in line
