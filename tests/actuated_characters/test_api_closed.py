"""A closed simulation stays closed, and touches none of those that come after it."""

import gc
import threading
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

import actuated_characters as ac
from msgs_config.errors import CharacterError, ClosedError
from msgs_config.messages.throw import ProjectileThrow
from tests.support.engines import Engine, need_engine, open_worlds, pybullet
from tests.support.physics import character as shared_character
from tests.support.urdf import inertial, joint, link, robot

START = ac.StampedState(0, np.array([0.3]), np.array([-1.0]), None)
BALL = ProjectileThrow(1.0, 0.1, (0.5, 0.0, 1.0), (-6.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def pendulum() -> ac.Character:
    return shared_character("pendulum")


@pytest.fixture
def closed(pendulum: ac.Character) -> ac.Simulation:
    simulation = ac.Simulation(pendulum)
    simulation.step([1.0])
    simulation.close()
    return simulation


@pytest.fixture(autouse=True)
def no_engine_is_left() -> Iterator[None]:
    gc.collect()
    before = open_worlds()
    yield
    gc.collect()
    assert open_worlds() == before


def ten_steps(character: ac.Character, meanwhile: Callable[[], object] | None = None) -> str:
    with ac.Simulation(character) as simulation:
        for step in range(10):
            simulation.step([1.0])
            if step == 4 and meanwhile is not None:
                meanwhile()
        return simulation.state_hash


USES: dict[str, Callable[[ac.Simulation], object]] = {
    "step": lambda it: it.step([50.0]),
    "reset": lambda it: it.reset(),
    "reset to a state": lambda it: it.reset(START),
    "push": lambda it: it.push("rod", force=(1.0, 0.0, 0.0)),
    "state": lambda it: it.state,
    "contacts": lambda it: it.contacts,
    "a throw": lambda it: it._simulation.step([np.zeros(1)], None, [BALL]),
    "a snapshot": lambda it: it._simulation.snapshot(),
    "another start": lambda it: it._simulation.begin_in({"": START}),
    "the links": lambda it: it._simulation.characters[0].link_frames(),
    "the balls": lambda it: it._simulation._world.balls.add(BALL),
    "gravity": lambda it: it._simulation._world.set_gravity(1.0),
}


@pytest.mark.parametrize("use", USES.values(), ids=USES)
def test_what_is_closed_can_be_used_no_more(
    pendulum: ac.Character, closed: ac.Simulation, use: Callable[[ac.Simulation], object]
) -> None:
    alone = ten_steps(pendulum)

    def refused() -> None:
        with pytest.raises(ClosedError, match="closed"):
            use(closed)

    refused()
    assert ten_steps(pendulum, refused) == alone


def test_a_snapshot_is_not_loaded_by_what_is_closed(
    pendulum: ac.Character, closed: ac.Simulation
) -> None:
    with ac.Simulation(pendulum) as other:
        other.step([1.0])
        saved = other._simulation.snapshot()
        with pytest.raises(ClosedError, match="closed"):
            closed._simulation.load_snapshot(saved)
        before = other.state.position.copy()
        other._simulation.load_snapshot(saved)
        assert np.array_equal(other.state.position, before)


def test_a_second_close_does_nothing(pendulum: ac.Character, closed: ac.Simulation) -> None:
    alone = ten_steps(pendulum)
    closed.close()
    assert ten_steps(pendulum, closed.close) == alone
    with ac.Simulation(pendulum) as one:
        one.close()  # and once more where the block ends


def test_what_it_knew_of_itself_it_still_knows(closed: ac.Simulation) -> None:
    assert closed.ticks == 1
    assert closed.time == pytest.approx(1 / 240)
    assert len(closed.state_hash) == 64


def test_it_may_be_closed_by_another_thread(pendulum: ac.Character) -> None:
    alone = ten_steps(pendulum)
    simulation = ac.Simulation(pendulum)
    closer = threading.Thread(target=simulation.close)
    closer.start()
    closer.join()
    assert ten_steps(pendulum, simulation.close) == alone
    with pytest.raises(ClosedError, match="closed"):
        simulation.step([0.0])


def test_one_that_is_forgotten_is_closed(pendulum: ac.Character) -> None:
    before = open_worlds()
    simulation = ac.Simulation(pendulum)
    assert open_worlds() == before + 1
    alone = ten_steps(pendulum)
    state = simulation.state
    del simulation
    gc.collect()
    assert open_worlds() == before
    assert state.effort is None
    assert ten_steps(pendulum) == alone


def test_a_world_that_cannot_be_built_leaves_no_engine(tmp_path: Path) -> None:
    need_engine("bullet")  # MuJoCo keeps the model of a character, and needs its files no more
    mesh = tmp_path / "box.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    shape = '<collision><geometry><mesh filename="box.obj"/></geometry></collision>'
    parts = (link("world", ""), joint("hinge", "world", "arm"), link("arm", inertial() + shape))
    (tmp_path / "robot.urdf").write_text(robot(*parts))
    character = ac.load_character(str(tmp_path / "robot.urdf"))
    before = open_worlds()
    simulation = ac.Simulation(character)
    mesh.unlink()
    with pytest.raises(CharacterError, match=r"box\.obj"):
        ac.Simulation(character)
    assert open_worlds() == before + 1
    with pytest.raises(CharacterError, match=r"box\.obj"):
        simulation.reset()
    assert open_worlds() == before
    with pytest.raises(ClosedError, match="closed"):
        simulation.step([0.0])
    simulation.close()


def test_a_terrain_that_cannot_be_loaded_leaves_no_engine(
    pendulum: ac.Character, tmp_path: Path
) -> None:
    before = open_worlds()
    (tmp_path / "ground.urdf").write_text("<robot/>")
    with pytest.raises(ac.ActuatedCharactersError) as caught:
        ac.Simulation(pendulum, terrain=str(tmp_path / "ground.urdf"))
    assert open_worlds() == before
    assert "ground.urdf" in str(caught.value)


def test_an_engine_gives_its_number_until_it_is_closed() -> None:
    first, second = Engine(), Engine()
    number = int(first)
    assert pybullet.isConnected(first)
    first.close()
    with closing(Engine()) as third:
        assert int(third) == number  # PyBullet gives it again
        first.close()
        with pytest.raises(ClosedError, match="closed"):
            pybullet.stepSimulation(physicsClientId=first)
        with pytest.raises(ClosedError, match="closed"), first.alone():
            pass
        with third.alone():
            assert pybullet.isConnected(third)
    second.close()


def test_a_closed_environment_is_no_fall() -> None:
    gymnasium = pytest.importorskip("gymnasium")
    from actuated_characters import environments  # noqa: F401  registers them

    made = [
        gymnasium.make("actuated_characters/Track-v0", character="pendulum", reference="hold")
        for _ in range(2)
    ]
    made[0].reset(seed=0)
    made[0].close()
    made[1].reset(seed=0)
    action = np.zeros(made[1].action_space.shape)
    with pytest.raises(ClosedError, match="closed"):
        made[0].step(action)
    with pytest.raises(ClosedError, match="closed"):
        made[0].reset()
    made[0].close()
    assert not made[1].step(action)[2]
    made[1].close()
