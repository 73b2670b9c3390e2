"""The Python API gives the states of the nodes, and says in one line what is wrong."""

import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import actuated_characters as ac
from actuated_characters.bags.reader import read_messages
from actuated_characters.metrics.state_hash import StateHash
from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import make_plan
from actuated_characters.runs.planned.wrenches import parse_push
from msgs_config.bus.ros_state import read_state
from tests.support.engines import open_worlds
from tests.support.ros import Processes

ROOT = Path(__file__).parents[2]
SWINGING = {"reference": "sine", "sine.amplitude": 0.5}


def code_blocks(page: str) -> list[str]:
    text = (ROOT / page).read_text("utf-8")
    return re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)


def hash_of_run(
    character: str, duration: float, *pushes: str, **settings: dict[str, object]
) -> str:
    """The hash of a run in one process, which is that of one over topics."""
    reference, controller = settings.get("reference", {}), settings.get("controller", {})
    plan = make_plan(character, duration, reference, {}, controller)
    states = StateHash()
    for number, tick in enumerate(
        ticks_in_process(plan, [parse_push(push, plan) for push in pushes])
    ):
        if number == 0:
            states.add(tick.state)
        states.add(tick.following)
    return states.hexdigest()


@pytest.fixture(scope="module")
def pendulum() -> ac.Character:
    return ac.load_character("pendulum")


@pytest.fixture
def world(pendulum: ac.Character) -> Iterator[ac.Simulation]:
    with ac.Simulation(pendulum) as simulation:
        yield simulation


def test_the_import_loads_neither_ros_nor_an_engine() -> None:
    code = "import actuated_characters, sys; print(*sorted(sys.modules))"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert not {"rclpy", "pybullet", "mujoco", "numpy", "gymnasium"} & set(loaded)


def test_all_names_are_there() -> None:
    assert set(ac.__all__) <= set(dir(ac))
    for name in ac.__all__:
        assert getattr(ac, name)
    with pytest.raises(AttributeError, match="no attribute 'simulation'"):
        _ = ac.simulation


def test_the_lines_of_the_readme_have_the_hash_of_the_run_that_they_name() -> None:
    (code,) = [block for block in code_blocks("README.md") if "import actuated_characters" in block]
    assert len(code.splitlines()) <= 10
    printed = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout
    walk: dict[str, object] = {"reference": "clip", "clip": "walk"}
    assert printed.split()[0] == hash_of_run(
        "humanoid", 2.0, reference=walk, controller={"planner": "policy"}
    )


def test_the_lines_of_the_page_work() -> None:
    code = code_blocks("docs/python.md")[0]
    printed = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout
    assert printed.startswith("('root_x', 'root_y', 'root_z') [")


def test_a_push_is_that_of_a_run(pendulum: ac.Character) -> None:
    controller = ac.Controller(pendulum, SWINGING)
    with ac.Simulation(pendulum, controller.start) as simulation:
        for tick in range(120):
            if tick == 60:
                simulation.push("rod", force=(2.0, 0.0, 0.0))
            simulation.step(controller.compute_effort(simulation.state))
        assert simulation.ticks == 120
        pushed = simulation.state_hash

    assert pushed == hash_of_run("pendulum", 0.5, "rod:2,0,0@0.25", controller=SWINGING)
    assert pushed != hash_of_run("pendulum", 0.5, controller=SWINGING)


def test_a_reset_is_a_fresh_world(pendulum: ac.Character, world: ac.Simulation) -> None:
    effort = np.array([3.0])
    once = [world.step(effort).position for _ in range(20)]
    first = world.reset()
    again = [world.step(effort).position for _ in range(20)]

    assert first.effort is None
    assert world.time == pytest.approx(20 / 240)
    assert np.array_equal(once, again)

    start = ac.StampedState(0, np.array([0.3]), np.array([-1.0]), None)
    elsewhere = world.reset(start)
    assert (*elsewhere.position, *elsewhere.velocity) == (0.3, -1.0)
    with ac.Simulation(pendulum, start) as fresh:
        assert np.array_equal(world.step(effort).position, fresh.step(effort).position)


def test_a_world_that_is_left_or_closed_has_no_engine(pendulum: ac.Character) -> None:
    before = open_worlds()

    with ac.Simulation(pendulum):
        assert open_worlds() == before + 1
    assert open_worlds() == before
    other = ac.Simulation(pendulum)
    other.close()

    assert open_worlds() == before


def test_parameters_act_on_both_sides(pendulum: ac.Character) -> None:
    with ac.Simulation(pendulum, gravity=0.0, rate=480) as simulation:
        assert simulation.rate_hz == 480
        resting = [simulation.step(np.zeros(1)).velocity for _ in range(50)]
    assert np.array_equal(np.zeros((50, 1)), resting)

    firm, soft = (ac.Controller(pendulum, {"gains.hinge.p": p}, law="p") for p in (100.0, 10.0))
    away = ac.StampedState(4166666, np.array([0.1]), np.zeros(1), None)
    assert firm.compute_effort(away) == pytest.approx(10.0 * soft.compute_effort(away))


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda one: ac.Controller(one, law="magic"), "parameter 'law': 'magic'"),
        (lambda one: ac.Controller(one, clip="walk"), "clip"),
        (lambda one: ac.Controller(one, {"clip": "walk"}), "no clips"),
        (lambda one: ac.Controller(one, clip="walk", reference="sine"), "'reference' is sine"),
        (lambda one: ac.Controller(one, clip="a", keyframes="b"), "give one of them"),
        (lambda _: ac.run(output="none", clip="a", controller={"clip": "b"}), "give one of them"),
        (lambda _: ac.run(output="none", in_process=True, composed=True), "composed must be false"),
        (lambda one: ac.Simulation(one, graviti=1.0), "graviti"),
        (lambda one: ac.Simulation(one).step(np.zeros(3)), r"shape \(3,\); it must be \(1,\)"),
        (lambda one: ac.Simulation(one).push("wing", (1.0, 0.0, 0.0)), "wing"),
        (lambda one: ac.Simulation(one, watch_contacts=False).contacts, "watch_contacts=True"),
        (lambda _: ac.load_character("nobody"), "nobody"),
    ],
    ids=[
        "law",
        "clip",
        "named",
        "two",
        "both",
        "twice",
        "ways",
        "parameter",
        "effort",
        "link",
        "contacts",
        "character",
    ],
)
def test_a_mistake_is_one_clear_line(wrong, words, pendulum) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ac.ActuatedCharactersError, match=words) as raised:
        wrong(pendulum)
    assert "\n" not in str(raised.value)


@pytest.mark.nightly
@pytest.mark.slow
def test_a_run_over_topics_has_the_hash_of_the_lines_of_the_api(tmp_path: Path) -> None:
    metrics = ac.run("pendulum", 0.5, output=tmp_path / "run", controller=SWINGING)

    assert metrics["state_hash"] == hash_of_run("pendulum", 0.5, controller=SWINGING)
    with pytest.raises(ac.ActuatedCharactersError, match="overwrite"):
        ac.run("pendulum", 0.5, output=tmp_path / "run")
    for way in ("in_process", "composed"):
        again = ac.run(
            "pendulum",
            0.5,
            output=tmp_path / "run",
            overwrite=True,
            controller=SWINGING,
            **{way: True},
        )
        assert again["state_hash"] == metrics["state_hash"]


@pytest.mark.slow
def test_the_node_of_the_page_answers_as_controller_node_would(
    tmp_path: Path, processes: Processes
) -> None:
    (code,) = [block for block in code_blocks("docs/python.md") if "import rclpy" in block]
    assert sum(bool(line) for line in code.splitlines()) <= 21
    (tmp_path / "holder.py").write_text(code, encoding="utf-8")
    processes.python("holder.py")
    recorder = processes.node("recorder", directory=str(tmp_path / "recording"))
    simulator = processes.simulator(character="franka_panda", max_ticks=120, wait_for_subscribers=2)
    assert simulator.wait() == 0
    recorder.send(signal.SIGINT)
    assert recorder.wait() == 0

    states, layout = StateHash(), ac.load_character("franka_panda").layout
    messages = read_messages(tmp_path / "recording" / "bag", ["/joint_states"])
    seen = [read_state(layout, message.decode()) for message in messages]
    for state in {state.stamp_ns: state for state in seen}.values():  # some are published again
        states.add(state)
    law: dict[str, object] = {"law": "computed_torque"}
    assert states.hexdigest() == hash_of_run("franka_panda", 0.5, controller=law)
