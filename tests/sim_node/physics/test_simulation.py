"""The tick: an effort in, the next state out, and nothing else that matters."""

import hashlib

import numpy as np
import pytest

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import ROOT
from msgs_config.errors import ConfigurationError, LayoutError, SimulationError
from sim_node.physics.wrenches import ExternalWrench
from tests.support.physics import LoneSimulation, character, momentum, simulation

pytestmark = pytest.mark.usefixtures("engine")

HUMANOID = character("humanoid").layout
LINKS = [link.name for link in character("humanoid").links]


def humanoid_efforts(ticks: int, size: float = 20.0) -> list[FloatArray]:
    """Random efforts in every joint, none on the root."""
    rng = np.random.default_rng(1)
    motors = np.concatenate((np.zeros(6), np.ones(HUMANOID.size - 6)))
    return [size * motors * rng.normal(size=HUMANOID.size) for _ in range(ticks)]


def run_hash(simulation_: LoneSimulation, efforts: list[FloatArray]) -> str:
    """A hash of everything in every state."""
    digest = hashlib.sha256()
    with simulation_:
        for effort in efforts:
            state = simulation_.advance(effort)
            digest.update(state.stamp_ns.to_bytes(8, "big"))
            digest.update(state.position.tobytes() + state.velocity.tobytes())
            digest.update(b"" if state.effort is None else state.effort.tobytes())
    return digest.hexdigest()


# --- states and stamps ---------------------------------------------------------------------------


def test_the_first_state_is_the_initial_one_at_tick_one_without_an_effort() -> None:
    rng = np.random.default_rng(2)
    position, velocity = rng.uniform(-0.5, 0.5, (2, HUMANOID.size))

    with simulation(
        "humanoid", initial_position=position.tolist(), initial_velocity=velocity.tolist()
    ) as run:
        state = run.state

    assert run.tick == 1
    assert state.stamp_ns == 10**9 // 240
    assert state.effort is None
    np.testing.assert_allclose(state.position, position, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(state.velocity, velocity, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("rate", [7, 240, 1000])
def test_stamps_are_whole_ticks_of_the_rate(rate: int) -> None:
    with simulation("lift", rate=rate) as run:
        stamps = [run.state.stamp_ns]
        stamps += [run.advance(np.zeros(1)).stamp_ns for _ in range(rate)]

    assert stamps == [tick * 10**9 // rate for tick in range(1, rate + 2)]


def test_a_tick_lasts_its_period_whatever_the_substeps() -> None:
    for substeps in (1, 2, 5):
        with simulation("lift", rate=100, substeps=substeps) as run:
            state = run.advance(np.zeros(1))

            assert state.velocity[0] == pytest.approx(-9.81 / 100, abs=1e-12)
            fallen = 9.81 * (substeps + 1) / (2 * substeps) / 100**2
            assert state.position[0] == pytest.approx(1.0 - fallen, abs=1e-12)


def test_a_tick_of_four_substeps_is_four_ticks_at_four_times_the_rate() -> None:
    assisted = [ROOT, *HUMANOID.actuated_joint_names]
    efforts = humanoid_efforts(60, size=2.0)
    for effort in efforts:
        effort[:6] = 50.0  # a force stays in the world, a torque turns with the base
    with (
        simulation("humanoid", rate=240, substeps=4, commanded_joints=assisted) as coarse,
        simulation("humanoid", rate=960, commanded_joints=assisted) as fine,
    ):
        for effort in efforts:
            state = coarse.advance(effort)
            for _ in range(4):
                fine_state = fine.advance(effort)

            assert state.position.tobytes() == fine_state.position.tobytes()
            assert state.velocity.tobytes() == fine_state.velocity.tobytes()


def test_a_run_is_a_function_of_its_inputs() -> None:
    efforts = humanoid_efforts(240, size=2.0)

    first = run_hash(simulation("humanoid"), efforts)

    assert run_hash(simulation("humanoid"), efforts) == first
    assert run_hash(simulation("humanoid", friction=0.8), efforts) != first


# --- efforts -------------------------------------------------------------------------------------


def test_the_effort_in_a_state_is_the_one_that_was_applied_in_the_tick_before() -> None:
    efforts = humanoid_efforts(5)
    with simulation("humanoid") as run:
        for effort in efforts:
            state = run.advance(effort)

            assert state.effort is not None
            np.testing.assert_array_equal(state.effort, effort)


@pytest.mark.parametrize("zero", [0.0, -0.0])
def test_a_zero_effort_has_one_sign_whatever_the_senders(zero: float) -> None:
    with simulation("lift") as run:
        state = run.advance(np.array([zero]))

    assert state.effort is not None
    assert state.effort.tobytes() == np.zeros(1).tobytes()


def test_an_effort_is_clipped_and_a_ball_joints_keeps_its_direction() -> None:
    effort = np.zeros(HUMANOID.size)
    effort[HUMANOID.joint("right_knee").entries] = 1000.0
    effort[HUMANOID.joint("left_knee").entries] = -151.0
    effort[HUMANOID.joint("right_elbow").entries] = 59.0
    effort[HUMANOID.joint("chest").entries] = 300.0, 0.0, -400.0  # the limit is 200 N m
    effort[HUMANOID.joint("right_hip").entries] = 100.0, 100.0, 100.0
    with simulation("humanoid") as run:
        applied = run.advance(effort).effort

    assert applied is not None
    assert applied[HUMANOID.joint("right_knee").entries] == [150.0]
    assert applied[HUMANOID.joint("left_knee").entries] == [-150.0]
    assert applied[HUMANOID.joint("right_elbow").entries] == [59.0]
    chest, hip = (applied[HUMANOID.joint(name).entries] for name in ("chest", "right_hip"))
    np.testing.assert_allclose(chest, [120.0, 0.0, -160.0], rtol=1e-14)
    np.testing.assert_array_equal(hip, [100.0, 100.0, 100.0])


def test_what_moves_the_character_is_the_clipped_effort() -> None:
    excessive = np.zeros(HUMANOID.size)
    excessive[HUMANOID.joint("chest").entries] = 300.0, 0.0, -400.0
    with simulation("humanoid") as clipping, simulation("humanoid") as within_limits:
        clipped = clipping.advance(excessive)
        assert clipped.effort is not None
        expected = within_limits.advance(clipped.effort)

    assert clipped.velocity.tobytes() == expected.velocity.tobytes()


def test_a_caller_may_use_its_array_again() -> None:
    effort = np.array([3.0])
    with simulation("lift", command_delay_ticks=1) as run:
        run.advance(effort)
        effort[0] = 5.0
        state = run.advance(effort)
        effort[0] = 7.0

    # the command of the first tick, as it was then
    assert state.effort is not None
    assert state.effort[0] == 3.0


# --- delay ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_a_command_is_applied_its_delay_later_and_zero_before(delay: int) -> None:
    commands = [np.array([float(k)]) for k in range(1, 9)]
    with simulation("lift", command_delay_ticks=delay) as run:
        applied = [run.advance(command).effort for command in commands]

    expected = [0.0] * delay + [float(k) for k in range(1, 9 - delay)]
    assert [effort[0] for effort in applied if effort is not None] == expected


def test_a_delayed_run_is_the_run_of_the_commands_moved_by_the_delay() -> None:
    efforts = humanoid_efforts(60, size=2.0)
    moved = [np.zeros(HUMANOID.size)] * 2 + efforts[:-2]

    delayed = run_hash(simulation("humanoid", command_delay_ticks=2), efforts)

    assert delayed == run_hash(simulation("humanoid"), moved)


# --- pushes --------------------------------------------------------------------------------------


def a_push(link: str, force: tuple[float, float, float], ticks: int = 1) -> ExternalWrench:
    """A push at a link's origin, from the first tick on."""
    return ExternalWrench(
        LINKS.index(link), np.array([*force, 0.0, 0.0, 0.0]), np.zeros(3), 1, ticks
    )


@pytest.mark.parametrize("substeps", [1, 4])
def test_a_push_acts_over_the_whole_tick_and_not_beyond_it(substeps: int) -> None:
    # high above the ground, without gravity
    start = [0.0, 0.0, 5.0] + [0.0] * (HUMANOID.size - 3)
    whole, nothing = character("humanoid"), np.zeros(HUMANOID.size)
    force = (120.0, -60.0, 240.0)
    with simulation(
        "humanoid", initial_position=start, substeps=substeps, rate=1000, gravity=0.0
    ) as run:
        run.advance(nothing, a_push("chest", force))
        pushed, _ = momentum(run.simulated._body, whole)
        run.advance(nothing)
        coasting, _ = momentum(run.simulated._body, whole)

    # the impulse is the force times the tick
    np.testing.assert_allclose(pushed, np.array(force) / 1000.0, rtol=2e-2)
    np.testing.assert_allclose(coasting, pushed, rtol=2e-2, atol=1e-3)


def test_a_push_stays_in_the_world_while_its_link_turns() -> None:
    # in the void, the body turns by a radian in each tick
    start = [0.0, 0.0, 50.0] + [0.0] * (HUMANOID.size - 3)
    spin = [0.0] * HUMANOID.size
    spin[5] = 10.0
    whole, force = character("humanoid"), (300.0, 0.0, 0.0)
    with simulation(
        "humanoid",
        rate=10,
        substeps=1000,
        gravity=0.0,
        initial_position=start,
        initial_velocity=spin,
    ) as run:
        before, _ = momentum(run.simulated._body, whole)
        push = a_push("root", force)

        run.advance(np.zeros(HUMANOID.size), push)
        after, _ = momentum(run.simulated._body, whole)

    # had it turned with the link, a half of it would be along y
    np.testing.assert_allclose(after - before, [30.0, 0.0, 0.0], rtol=0.0, atol=0.5)


def test_the_actor_keeps_what_pushed_it_in_the_last_tick() -> None:
    push = a_push("neck", (1.0, 2.0, 3.0))
    with simulation("humanoid") as run:
        assert run.simulated.pushes == ()

        run.advance(np.zeros(HUMANOID.size), push)
        during = run.simulated.pushes
        run.advance(np.zeros(HUMANOID.size))

        assert during == (push,)
        assert run.simulated.pushes == ()


# --- contacts ------------------------------------------------------------------------------------


@pytest.mark.parametrize("substeps", [1, 3])
def test_watching_the_contacts_changes_no_bit_of_what_follows(substeps: int) -> None:
    efforts = humanoid_efforts(240, size=2.0)
    with (
        simulation("humanoid", substeps=substeps) as blind,
        simulation("humanoid", substeps=substeps) as watching,
    ):
        watching.watches_contacts = True
        for effort in efforts:
            expected, state = blind.advance(effort), watching.advance(effort)

            assert state.position.tobytes() == expected.position.tobytes()
            assert state.velocity.tobytes() == expected.velocity.tobytes()
        assert blind.simulated.contacts is None
        assert watching.simulated.contacts is not None
        assert watching.simulated.contacts.touching.any()


def test_a_contact_in_any_of_a_ticks_substeps_is_one() -> None:
    efforts = humanoid_efforts(120, size=2.0)
    with simulation("humanoid", rate=60, substeps=4) as coarse, simulation("humanoid") as fine:
        coarse.watches_contacts = fine.watches_contacts = True
        for effort in efforts:
            coarse.advance(effort)
            touched, wrenches = np.zeros(len(LINKS), dtype=np.bool_), np.zeros((len(LINKS), 6))
            for _ in range(4):
                fine.advance(effort)
                assert fine.simulated.contacts is not None
                touched |= fine.simulated.contacts.touching
                wrenches += 0.25 * fine.simulated.contacts.wrenches

            assert coarse.simulated.contacts is not None
            np.testing.assert_array_equal(coarse.simulated.contacts.touching, touched)
            np.testing.assert_allclose(coarse.simulated.contacts.wrenches, wrenches, atol=1e-9)


# --- errors --------------------------------------------------------------------------------------


def test_a_divergence_names_the_joint_that_is_too_fast() -> None:
    layout = character("franka_panda").layout
    velocity = np.zeros(layout.size)
    velocity[layout.joint("panda_joint5").entries] = -20.0
    with (
        simulation("franka_panda", initial_velocity=velocity.tolist(), speed_limit=15.0) as run,
        pytest.raises(SimulationError, match="'panda_joint5'"),
    ):
        run.advance(np.zeros(layout.size))


def test_a_state_that_is_no_number_is_a_divergence() -> None:
    with (
        simulation("pendulum") as run,
        pytest.raises(SimulationError, match="'hinge' is at nan"),
    ):
        run.advance(np.array([np.nan]))


@pytest.mark.parametrize("name", ["initial_position", "initial_velocity"])
def test_an_initial_state_of_the_wrong_length_is_an_error_that_lists_the_entries(name: str) -> None:
    with pytest.raises(ConfigurationError, match=f"'{name}' has 3 entries.*34: root_x, root_y"):
        simulation("humanoid", **{name: [0.0, 0.0, 0.9]})


@pytest.mark.parametrize(
    "joints", [None, [ROOT, *HUMANOID.actuated_joint_names], ["neck", "right_knee"]]
)
def test_the_listed_joints_are_commanded_and_by_default_all_but_the_root(
    joints: list[str] | None,
) -> None:
    given = {} if joints is None else {"commanded_joints": joints}
    with simulation("humanoid", **given) as run:
        expected = HUMANOID.mask(joints or HUMANOID.actuated_joint_names)

        np.testing.assert_array_equal(run.simulated.commanded, expected)


def test_an_unknown_commanded_joint_is_an_error_that_lists_those_that_exist() -> None:
    with pytest.raises(LayoutError, match=r"'tail'.*right_knee"):
        simulation("humanoid", commanded_joints=["tail"])
