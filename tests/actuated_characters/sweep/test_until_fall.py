"""Rows that end at the fall say what whole ones say, wherever they begin."""

from pathlib import Path

import pytest

from actuated_characters.commands.common.row_runs import asked_run
from actuated_characters.sweep import until_fall
from actuated_characters.sweep.row import Outcome, RowTask, compute
from actuated_characters.sweep.until_fall import run_row_until_fall

pytestmark = [pytest.mark.slow, pytest.mark.sharing]

STAND = (
    *("--keyframes=humanoid_stand", "--duration=2.2"),
    "--set=controller_node.root_assistance:=false",
    "--set=controller_node.balance.enabled:=true",
)
SENT = (  # before and after the push
    *("--machine=walk", "--cmd-vel=0.9,0,0@0.2 0.5,0,0.2@1.1", "--duration=2.4"),
    "--throw=mass=0.3 speed=5 at=0.6 target=chest",
    "--throw=mass=0.5 speed=5 at=1.5 target=root",
)
POLICY = ("--clip=walk", "--planner=policy", "--duration=2.0")


def push(newton_seconds: float, at: float) -> str:
    return f"--push=impulse={newton_seconds} from=60 at={at} target=chest"


def outcome(arguments: tuple[str, ...], scratch: Path, *, ends_at_fall: bool) -> Outcome:
    task = RowTask(1, arguments, "none", scratch, until_fall=ends_at_fall)
    return compute(task, asked_run, scratch, run_row_until_fall if ends_at_fall else None)


@pytest.mark.parametrize(
    ("arguments", "does_fall"),
    [
        ((*STAND, push(5, 1.0)), False),
        ((*STAND, push(60, 1.0)), True),
        ((*STAND, push(60, 0.0)), True),  # with the first tick
        ((*STAND, push(60, 1.0), push(60, 0.3)), True),
        ((*STAND, "--set=controller_node.balance.enabled:=false", push(5, 2.1)), True),  # before
        (STAND, False),
        pytest.param((*SENT, push(10, 1.0)), False, marks=pytest.mark.nightly),
        pytest.param((*SENT, push(90, 1.0)), True, marks=pytest.mark.nightly),
        ((*POLICY, "--set=sim_node.engine:=mujoco", push(20, 0.9)), False),
        ((*POLICY, "--set=sim_node.engine:=mujoco", push(90, 0.9)), True),
    ],
)
def test_it_falls_at_the_tick_at_which_the_whole_run_does(
    arguments: tuple[str, ...], does_fall: bool, tmp_path: Path
) -> None:
    whole = outcome(arguments, tmp_path, ends_at_fall=False)
    until_fall._keyframe.cache_clear()

    first = outcome(arguments, tmp_path, ends_at_fall=True)
    again = outcome(arguments, tmp_path, ends_at_fall=True)

    expected = {name: whole.figures[name] for name in ("fell", "fell_at_s")}
    assert expected["fell"] is does_fall
    assert first == again == Outcome(expected)


def test_what_comes_before_the_push_is_computed_once(tmp_path: Path) -> None:
    until_fall._keyframe.cache_clear()
    for side in (0, 120, 240):
        pushed = f"--push=impulse=20 from={side} at=1.0 target=chest"
        outcome((*STAND, pushed), tmp_path, ends_at_fall=True)
    outcome((*STAND, push(20, 1.1)), tmp_path, ends_at_fall=True)

    assert until_fall._keyframe.cache_info()[:2] == (2, 2)  # hits and misses


def test_a_row_that_cannot_be_is_refused(tmp_path: Path) -> None:
    refused = outcome((*STAND, "--push=chest:x"), tmp_path, ends_at_fall=True)

    assert refused.is_refused
    assert refused == outcome((*STAND, "--push=chest:x"), tmp_path, ends_at_fall=False)
