"""A policy and plans together: who leads when, one anchor, and the same bits again."""

import copy
import pickle
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from actuated_characters.bags.recording import read_recording
from actuated_characters.cli import main
from actuated_characters.metrics.run_metrics import Tick
from actuated_characters.replay.replay import replay
from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import RunPlan, make_plan
from actuated_characters.runs.planned.wrenches import plan_push
from controller_node.parameters import make_controller, make_controller_settings, resolve_for
from controller_node.planner.anchor import Anchor
from controller_node.planner.base import TickState
from controller_node.planner.policy import hybrid as module
from controller_node.planner.policy.hybrid import HybridPlanner
from controller_node.references.factory import make_motion
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedState
from tests.support.physics import character
from tests.support.runs import summary_of

HUMANOID = character("humanoid")
CLOCK = TickClock(240)
WALK: dict[str, object] = {"reference": "clip", "clip": "walk"}
GIVEN: dict[str, object] = {
    "planner": "hybrid",
    "plan.workers": 1,
    "plan.samples": 8,
    "plan.rounds": 2,
}
VALUES = resolve_for(HUMANOID, {**WALK, **GIVEN})
REFERENCE = make_motion(HUMANOID, VALUES).reference
GAINS = make_controller_settings(HUMANOID, VALUES).gains
DUPLICATES = pytest.mark.parametrize(
    "duplicate", [copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))]
)


@pytest.fixture(scope="module")
def made() -> HybridPlanner:
    planner = make_controller(HUMANOID, REFERENCE, VALUES).planner
    assert isinstance(planner, HybridPlanner)
    return planner


@pytest.fixture
def planner(made: HybridPlanner) -> HybridPlanner:
    made.begin_episode(0)
    return made


def desired_at(tick: int) -> object:
    return REFERENCE.sample(tick / 240)


def answer(planner: HybridPlanner, tick: int, slip: float = 0.0, moved: float = 0.0) -> bytes:
    """What it answers the reference's state with, or one that slips in m/s, or is moved in m, to
    the left.
    """
    state = REFERENCE.sample(tick / 240)
    velocity, position = state.velocity.copy(), state.configuration.position.copy()
    velocity[1] += slip
    position[1] += moved
    sent = StampedState(CLOCK.stamp_ns(tick), position, velocity, None)
    seen = TickState(tick, sent)
    return planner.offset(seen, seen, GAINS, desired_at).tobytes()  # type: ignore[arg-type]


def test_the_policy_leads_while_it_is_calm(planner: HybridPlanner) -> None:
    policy = make_controller(
        HUMANOID, REFERENCE, resolve_for(HUMANOID, {**WALK, "planner": "policy"})
    ).planner
    assert policy is not None

    for tick in range(60):
        state = REFERENCE.sample(tick / 240)
        sent = StampedState(
            CLOCK.stamp_ns(tick), state.configuration.position, state.velocity, None
        )
        seen = TickState(tick, sent)
        alone = policy.offset(seen, seen, GAINS, desired_at)  # type: ignore[arg-type]
        assert answer(planner, tick) == alone.tobytes()
        assert not planner.plans
    assert planner.outlook is not None
    assert planner.outlook.anchor == policy.outlook.anchor  # type: ignore[union-attr]


@pytest.mark.slow
def test_it_plans_from_a_hard_push_until_it_has_been_calm_for_a_while(
    planner: HybridPlanner,
) -> None:
    led = []
    for tick in range(0, 720, 4):
        answer(planner, tick, slip=1.5 if 48 <= tick < 96 else 0.0)
        led.append(planner.plans)

    begun, over = led.index(True), len(led) - led[::-1].index(True)
    assert 48 <= 4 * begun <= 48 + 32  # within four decisions of 8 ticks
    assert all(led[begun:over])
    # It is perturbed for 1 s after the push, and then has to be calm for a while.
    assert 4 * over >= 96 + 240 * (1.0 + module._CALM_S) - 16
    assert 4 * over < 96 + 2 * 240


@pytest.mark.slow
def test_it_plans_for_a_clip_without_a_policy(planner: HybridPlanner) -> None:
    led = []
    for tick in range(0, 320):
        if tick in (19, 64):  # in the midst of a decision
            planner.change_reference(tick, "unheard-of" if tick == 19 else "")
        answer(planner, tick)
        led.append(planner.plans)

    assert not any(led[:19]) and all(led[19:64]), "from the change on"
    assert not all(led[64:]), "it has been calm for a while"


@pytest.mark.nightly
def test_who_takes_over_sees_the_reference_where_it_had_given_way_to(
    planner: HybridPlanner,
) -> None:
    anchors = []
    for tick in range(0, 720, 4):
        before = planner.plans, planner._policy.anchor, planner._predictive.anchor
        moved = min(max(tick - 48, 0) / 48, 1.0) * 0.3
        answer(planner, tick, slip=1.5 if 48 <= tick < 96 else 0.0, moved=moved)
        if planner.plans and not before[0]:  # plans take over: nothing is lost of the place
            anchors.append(planner._policy.anchor)
            assert _near(planner._predictive.anchor, planner._policy.anchor)
        elif before[0] and not planner.plans:
            anchors.append(before[2])
            assert _near(planner._policy.anchor, before[2])
    assert len(anchors) >= 2
    assert abs(anchors[1].place) > 0.02


def _near(one: Anchor, other: Anchor) -> bool:
    """Whether nothing jumps: what gives way within a decision."""
    return abs(one.place - other.place) < 0.01 and abs(one.yaw - other.yaw) < 0.02


@pytest.mark.slow
def test_a_state_that_comes_again_is_answered_alike(planner: HybridPlanner) -> None:
    once = [answer(planner, tick, slip=1.5) for tick in range(0, 48, 4)]
    assert planner.plans
    planner.begin_episode(0)

    for number, tick in enumerate(range(0, 48, 4)):
        assert {answer(planner, tick, slip=1.5) for _ in range(3)} == {once[number]}


@DUPLICATES
def test_a_copy_goes_on_where_commands_are_late(
    duplicate: Callable[[HybridPlanner], HybridPlanner],
) -> None:
    values = resolve_for(HUMANOID, {**WALK, **GIVEN, "command_delay_ticks": 2})
    controller = make_controller(HUMANOID, REFERENCE, values)
    sent = [
        StampedState(CLOCK.stamp_ns(1 + tick), state.configuration.position, state.velocity, None)
        for tick, state in enumerate(REFERENCE.sample(tick / 240) for tick in range(12))
    ]
    first = sent[0].stamp_ns
    for state in sent[:6]:
        controller.compute_effort(state, first)

    copied = duplicate(controller)  # type: ignore[arg-type,type-var]

    for state in sent[6:]:
        expected, _ = controller.compute_effort(state, first)
        found, _ = copied.compute_effort(state, first)  # type: ignore[attr-defined]
        assert found.tobytes() == expected.tobytes()


@pytest.mark.slow
@DUPLICATES
@pytest.mark.parametrize("taken", [pytest.param(5, marks=pytest.mark.nightly), 30])
def test_a_copy_goes_on_to_the_same_bits(
    duplicate: Callable[[HybridPlanner], HybridPlanner], taken: int, planner: HybridPlanner
) -> None:
    for tick in range(taken):
        answer(planner, tick, slip=1.5 if tick > 5 else 0.0)
    assert planner.plans == (taken == 30)

    copied = duplicate(planner)

    assert copied.plans == planner.plans
    for tick in range(taken, taken + 20):
        assert answer(copied, tick, slip=1.5) == answer(planner, tick, slip=1.5)


def pushed(impulse: float, planner: str) -> Iterator[Tick]:
    """The ticks of a walk of 6 s that is pushed to the left after 1.2 s, N s."""
    plan: RunPlan = make_plan(
        "humanoid", 6.0, WALK, {"wrench_duration": 0.2}, {**GIVEN, "planner": planner}
    )
    return ticks_in_process(plan, [plan_push(plan, "root", (0.0, impulse / 0.2, 0.0), 1.2)])


@pytest.mark.nightly
@pytest.mark.slow
def test_it_bears_a_push_that_fells_the_policy() -> None:
    heights = {}
    for planner in ("policy", "hybrid"):
        heights[planner] = [tick.following.position[2] for tick in pushed(80.0, planner)]

    assert min(heights["policy"]) < 0.5
    assert min(heights["hybrid"]) > 0.6
    assert len(heights["hybrid"]) == 6 * 240


@pytest.mark.nightly
@pytest.mark.slow
def test_a_run_has_the_same_bits_again_and_in_a_replay(tmp_path: Path) -> None:
    hashes = []
    for name in ("one", "other"):
        command = ["run", "--in-process", "--clip", "walk", "--duration", "1.2"]
        command += ["--planner", "hybrid", "--push", "chest:0,500,0@0.4"]
        command += ["--set", "controller_node.plan.samples:=8"]
        command += ["--set", "controller_node.plan.rounds:=2", "--output", str(tmp_path / name)]
        assert main(command) == 0
        hashes.append(summary_of(tmp_path / name)["state_hash"])

    assert hashes[0] == hashes[1]
    recording = read_recording(tmp_path / "one")
    assert replay([recording]).identical
    checks = np.array([len(plan.costs) for plan in recording.plans])
    assert checks[0] == 1, "the policy leads first"
    assert checks[-1] > 1, "plans look ahead"
