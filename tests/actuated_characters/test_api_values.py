"""Numbers, sequences and paths of any kind are values, and do the same as Python's own."""

from collections.abc import Callable, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

import actuated_characters as ac
from msgs_config.errors import CommandError, ConfigurationError
from msgs_config.messages.throw import ProjectileThrow
from sim_node.physics.wrenches import WrenchQueue
from tests.support.physics import character as shared_character
from tests.support.urdf import inertial, joint, link, robot

SWING = robot(link("world", ""), joint("hinge", "world", "arm"), link("arm", inertial(2.5)))
GROUND = robot(link("ground", inertial(0)))
KEYFRAMES = """
keyframes:
  - {time: 0.0, pose: {hinge: 0.1}}
  - {time: 0.5, pose: {hinge: 0.4}}
"""


@pytest.fixture(scope="module")
def pendulum() -> ac.Character:
    return shared_character("pendulum")


@pytest.fixture(scope="module")
def humanoid() -> ac.Character:
    return shared_character("humanoid")


@pytest.fixture(scope="module")
def urdf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("robot") / "swing.urdf"
    path.write_text(SWING)
    return path


def hash_of(character: ac.Character, **parameters: object) -> str:
    with ac.Simulation(character, parameters=parameters) as simulation:
        for _ in range(5):
            simulation.step([0.5])
        return simulation.state_hash


SIMULATED: dict[str, tuple[object, object]] = {
    "gravity": (np.float64(1.625), 1.625),
    "friction": (np.float32(0.5), 0.5),
    "gravity ": (Fraction(13, 8), 1.625),
    "gravity  ": (np.array(1.625), 1.625),
    "rate": (np.int64(480), 480),
    "substeps": (np.uint8(2), 2),
    "initial_position": (np.array([0.5]), [0.5]),
    "initial_velocity": ((np.float32(0.25),), [0.25]),
    "commanded_joints": (("hinge",), ["hinge"]),
    "commanded_joints ": (np.array(["hinge"]), ["hinge"]),
    "placement": (np.zeros(4), [0.0, 0.0, 0.0, 0.0]),
    "terrain": (np.str_("none"), "none"),
}


@pytest.mark.parametrize("name", SIMULATED)
def test_a_simulation_takes_values_of_any_kind(pendulum: ac.Character, name: str) -> None:
    value, own = SIMULATED[name]
    assert hash_of(pendulum, **{name.strip(): value}) == hash_of(pendulum, **{name.strip(): own})


def effort_of(character: ac.Character, parameters: Mapping[str, object]) -> list[float]:
    controller = ac.Controller(character, parameters)
    size = character.layout.size
    state = ac.StampedState(4166666, np.full(size, 0.1), np.zeros(size), None)
    effort: list[float] = controller.compute_effort(state).tolist()
    return effort


def test_a_controller_takes_values_of_any_kind(humanoid: ac.Character) -> None:
    of_numpy = {
        "gains.right_knee.p": np.float64(400),
        "effort_limit.right_knee": np.float32(120),
        "root_assistance": np.bool_(False),
        "rate": np.int32(240),
        "clip": np.str_("walk"),
        "command_delay_ticks": np.array(0),
    }
    own = {
        "gains.right_knee.p": 400.0,
        "effort_limit.right_knee": 120.0,
        "root_assistance": False,
        "rate": 240,
        "clip": "walk",
        "command_delay_ticks": 0,
    }
    assert effort_of(humanoid, of_numpy) == effort_of(humanoid, own)
    assert effort_of(humanoid, of_numpy) != effort_of(humanoid, {"clip": "walk"})


REFUSED: dict[str, tuple[dict[str, object], str]] = {
    "nan": ({"gravity": np.float64("nan")}, "'gravity' is nan; it must be 0 to 1000 m/s^2"),
    "inf": ({"gravity": np.array(np.inf)}, "'gravity' is inf; it must be 0 to 1000 m/s^2"),
    "a flag": ({"gravity": np.bool_(True)}, "'gravity' is True; it must be a number"),
    "complex": ({"gravity": 1j}, "'gravity' is 1j; it must be a number"),
    "a list": ({"gravity": np.zeros(2)}, "'gravity' is a list; it must be a number"),
    "a column": ({"gravity": np.zeros((1, 1))}, "'gravity' is a list; it must be a number"),
    "an huge fraction": ({"gravity": Fraction(10**400)}, "it must be a number"),
    "no whole number": ({"rate": np.float64(240)}, "'rate' is 240.0; it must be a whole number"),
    "a flag as a count": ({"rate": np.True_}, "'rate' is True; it must be a whole number"),
    "a path as a number": ({"gravity": Path("x")}, "'gravity' is 'x'; it must be a number"),
    "a number as a path": ({"terrain": np.int64(3)}, "'terrain' is 3; it must be a text"),
    "a number as a list": ({"initial_position": np.float64(1)}, "is 1.0; it must be a list"),
    "a text as a list": ({"commanded_joints": "hinge"}, "is 'hinge'; it must be a list"),
    "a matrix": ({"initial_position": np.zeros((1, 1))}, "is a list; it must be a number"),
    "nan in a list": ({"initial_position": np.array([np.nan])}, "is nan; it must be -1e+12"),
    "too many": ({"initial_position": np.zeros(3)}, "has 3 entries; it must have 1: hinge"),
}


@pytest.mark.parametrize(("parameters", "message"), REFUSED.values(), ids=REFUSED)
def test_other_values_are_refused_in_a_line(
    pendulum: ac.Character, parameters: dict[str, object], message: str
) -> None:
    with pytest.raises(ConfigurationError) as caught:
        ac.Simulation(pendulum, parameters=parameters)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_path_is_a_name(humanoid: ac.Character, urdf: Path, tmp_path: Path) -> None:
    assert ac.load_character(urdf).mass == ac.load_character(str(urdf)).mass == 2.5
    assert ac.load_character(Path("pendulum")).name == "pendulum"
    clip = tmp_path / "own.json"
    with pytest.raises(ac.ActuatedCharactersError, match=r"own\.json: No such file"):
        ac.Controller(humanoid, clip=clip)
    keyframes = tmp_path / "frames.yaml"
    keyframes.write_text(KEYFRAMES)
    by_path, by_text = (
        ac.Controller(shared_character("pendulum"), keyframes=name)
        for name in (keyframes, str(keyframes))
    )
    assert by_path.start.position == by_text.start.position == [0.1]
    with pytest.raises(ac.ActuatedCharactersError, match=r"no\.yaml"):
        ac.Controller(humanoid, behaviour="state_machine", machine=tmp_path / "no.yaml")
    ground = tmp_path / "ground.urdf"
    ground.write_text(GROUND)
    assert hash_of(shared_character("pendulum"), terrain=ground)


@pytest.mark.parametrize("name", [None, 5, np.zeros(3), b"pendulum"])
def test_a_character_is_named_by_a_text_or_a_path(name: object) -> None:
    with pytest.raises(ac.ActuatedCharactersError, match="must be a name or a path"):
        ac.load_character(cast(str, name))


def test_a_run_takes_values_of_any_kind(urdf: Path, tmp_path: Path) -> None:
    results = [
        ac.run(character, duration, output=output, in_process=True, simulator={"gravity": gravity})
        for character, duration, output, gravity in (
            (urdf, np.float64(0.05), tmp_path / "one", np.float32(2.5)),
            (str(urdf), 0.05, str(tmp_path / "two"), 2.5),
            (urdf, Fraction(1, 20), tmp_path / "three", np.array(2.5)),
        )
    ]
    assert len({cast(str, each["state_hash"]) for each in results}) == 1


@pytest.mark.parametrize("duration", [np.nan, -1.0, "1", None, True, np.zeros(2), 10**400])
def test_a_duration_that_is_none_is_refused(duration: object, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"duration is .* s; it must be"):
        ac.run("pendulum", cast(float, duration), output=tmp_path / "run", in_process=True)


PUSHES: dict[str, Any] = {
    "two": (10, 0),
    "four": (10, 0, 0, 0),
    "one": 10.0,
    "none": None,
    "nan": (np.nan, 0, 0),
    "inf": np.array([0, -np.inf, 0]),
    "a text": "xyz",
    "a matrix": np.zeros((1, 3)),
    "complex": (1j, 0, 0),
}


@pytest.mark.parametrize("what", ["force", "torque"])
@pytest.mark.parametrize("vector", PUSHES.values(), ids=PUSHES)
def test_a_push_is_of_three_finite_numbers(
    pendulum: ac.Character, what: str, vector: object
) -> None:
    with ac.Simulation(pendulum) as simulation:
        with pytest.raises(CommandError, match=f"the {what} on 'rod' is .*3 finite numbers"):
            simulation.push("rod", **{what: cast(Any, vector)})
        undisturbed = [simulation.step([0.5]) for _ in range(5)][-1]
    with ac.Simulation(pendulum) as simulation:
        assert [simulation.step([0.5]) for _ in range(5)][-1].position == undisturbed.position


@pytest.mark.parametrize(
    "force", [(2, 0, 0), np.array([2, 0, 0]), [np.float32(2), 0.0, np.int8(0)]]
)
def test_a_push_takes_numbers_of_any_kind(pendulum: ac.Character, force: Any) -> None:
    pushed = []
    for each in (force, (2.0, 0.0, 0.0)):
        with ac.Simulation(pendulum) as simulation:
            simulation.push(np.str_("rod"), force=each)
            pushed.append([simulation.step([0.5]) for _ in range(5)][-1].position)
    assert pushed[0] == pushed[1]


@pytest.mark.parametrize("name", ["arm", None, ["rod"], 3])
def test_a_push_is_on_a_link_by_its_name(pendulum: ac.Character, name: object) -> None:
    with ac.Simulation(pendulum) as simulation, pytest.raises(CommandError, match="unknown link"):
        simulation.push(cast(str, name), force=(1.0, 0.0, 0.0))


def test_wrenches_and_points_have_six_and_three_numbers(pendulum: ac.Character) -> None:
    queue = WrenchQueue(pendulum)
    for wrenches, points, message in (
        (np.zeros((1, 5)), np.zeros((0, 3)), "a wrench has shape (5,); it must be (6,)"),
        (np.zeros((1, 6)), np.zeros((1, 2)), "a point has shape (2,); it must be (3,)"),
    ):
        with pytest.raises(CommandError) as caught:
            queue.add(["rod"], wrenches, points, first_tick=1, ticks=1)
        assert str(caught.value) == message
    assert not queue.take(1)


@pytest.mark.parametrize("vector", [(1.0, 2.0), (1.0, 2.0, 3.0, 4.0), ()])
def test_a_throw_begins_at_a_point_with_a_velocity(vector: Any) -> None:
    with pytest.raises(CommandError, match=r"the position is .* three numbers"):
        ProjectileThrow(1.0, 0.1, vector, (0.0, 0.0, 0.0))
    with pytest.raises(CommandError, match=r"the velocity is .* three numbers"):
        ProjectileThrow(1.0, 0.1, (0.0, 0.0, 0.0), vector)


@pytest.mark.parametrize("effort", [[1.5], (np.float32(1.5),), [Fraction(3, 2)], np.array([1.5])])
def test_an_effort_is_any_sequence_of_numbers(pendulum: ac.Character, effort: Any) -> None:
    with ac.Simulation(pendulum) as simulation:
        state = simulation.step(effort)
        assert state.effort is not None
        assert state.effort.tolist() == [1.5]


@pytest.mark.parametrize("effort", [["a"], [None], [1j], None, [[1.0]], [1.0, 2.0], 1.0, [[1], []]])
def test_an_effort_that_is_none_is_refused(pendulum: ac.Character, effort: Any) -> None:
    with ac.Simulation(pendulum) as simulation, pytest.raises(ConfigurationError, match="effort"):
        simulation.step(effort)


def states(position: object, velocity: object) -> ac.StampedState:
    return ac.StampedState(0, cast(Any, position), cast(Any, velocity), None)


def test_a_state_may_have_sequences_of_any_kind(pendulum: ac.Character) -> None:
    arrays, others = states(np.array([0.3]), np.array([-1.0])), states((0.3,), [np.float64(-1)])
    controller = ac.Controller(pendulum)
    assert np.array_equal(controller.compute_effort(arrays), controller.compute_effort(others))
    with ac.Simulation(pendulum, arrays) as one, ac.Simulation(pendulum, others) as other:
        assert one.step([0.0]).position == other.step([0.0]).position
        assert one.reset(others).position == [0.3]


USES: dict[str, Callable[[ac.Character, ac.StampedState], object]] = {
    "start": lambda character, state: ac.Simulation(character, state),
    "reset": lambda character, state: ac.Simulation(character).reset(state),
    "control": lambda character, state: ac.Controller(character).compute_effort(state),
}


@pytest.mark.parametrize("use", USES.values(), ids=USES)
def test_a_state_that_does_not_fit_is_refused(
    pendulum: ac.Character, use: Callable[[ac.Character, ac.StampedState], object]
) -> None:
    for wrong in (states([0.1, 0.2], [0.0, 0.0]), states([], []), states(None, None)):
        with pytest.raises(ConfigurationError, match=r"a state's position is .*1 finite number"):
            use(pendulum, wrong)


def test_a_state_that_does_not_fit_leaves_the_episode(pendulum: ac.Character) -> None:
    with ac.Simulation(pendulum) as simulation:
        simulation.step([1.0])
        with pytest.raises(ConfigurationError, match="finite"):
            simulation.reset(states([np.nan], [0.0]))
        assert simulation.ticks == 1


def test_contacts_of_another_shape_are_refused(humanoid: ac.Character) -> None:
    controller = ac.Controller(humanoid, clip="walk", behaviour="reactive")
    with pytest.raises(ConfigurationError, match=r"contacts have shape \(3,\); it must"):
        controller.compute_effort(controller.start, np.zeros(3))
