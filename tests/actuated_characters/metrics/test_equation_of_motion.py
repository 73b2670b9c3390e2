"""The lecture's equation tick by tick, by two engines: PyBullet's step, MuJoCo's M, C and J."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from actuated_characters.bags.recording import read_recording
from actuated_characters.metrics.equation_of_motion import EquationOfMotion, MotionResidual
from actuated_characters.runs.plan import make_plan
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.geometry import rotations
from sim_node.physics.wrenches import ExternalWrench
from tests.support.engines import needs_bullet
from tests.support.physics import (
    EVERY_CHARACTER,
    LoneSimulation,
    character,
    character_id,
    controller,
    random_state,
    run_together,
    simulation,
)
from tests.support.runs import run_plan_here

# The equation is of Bullet's velocities, which are the base's centre of mass; MuJoCo's, of its
# origin, leave over what the two differ by within a step, and would be held against MuJoCo itself.
pytestmark = needs_bullet

GRAVITY, RATE = 9.81, 240
ROUNDING = 1e-10
"""Of a residual against the largest part, which 1e-5 would do for."""

NOTICED = 1e-3
"""What is wrong shows by more than this."""

BOX_URDF = """
<robot name="box"><link name="box">
  <inertial>
    <origin xyz="0.02 0.01 -0.03" rpy="0.1 0.2 0.3"/>
    <mass value="2"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.15" iyz="0" izz="0.2"/>
  </inertial>
  <collision><geometry><box size="0.5 0.5 0.2"/></geometry></collision>
</link></robot>
"""


@dataclass
class Watched:
    """A simulation whose ticks are put into the equation."""

    run: LoneSimulation
    whole: Character
    equation: EquationOfMotion

    def advance(self, effort: FloatArray, *pushes: ExternalWrench) -> MotionResidual:
        """Take a tick."""
        self.before = self.run.state
        self.run.watches_contacts = True
        self.run.advance(effort, *pushes)
        return self.balance()

    def balance(self, **instead: FloatArray | tuple[ExternalWrench, ...]) -> MotionResidual:
        """The equation of the last tick; or of what it was not."""
        simulated, after = self.run.simulated, self.run.state
        assert after.effort is not None and simulated.contacts is not None
        known = {
            "position": self.before.position,
            "velocity": self.before.velocity,
            "effort": after.effort,
            "next_velocity": after.velocity,
            "contacts": simulated.contacts.wrenches,
            "pushes": simulated.pushes,
        }
        return self.equation.balance(**(known | instead))  # type: ignore[arg-type]

    @property
    def contacts(self) -> FloatArray:
        """The contact wrenches (links, 6) of the last tick."""
        assert self.run.simulated.contacts is not None
        return self.run.simulated.contacts.wrenches


Watch = Callable[..., Watched]


@pytest.fixture
def watch() -> Iterator[Watch]:
    """Makes watched simulations that end with the test."""
    runs: list[LoneSimulation] = []

    def make(name: str, **parameters: object) -> Watched:
        runs.append(simulation(name, **parameters))
        whole = character(name)
        return Watched(runs[-1], whole, EquationOfMotion(whole, GRAVITY, RATE))

    yield make
    for run in runs:
        run.close()


def touches_nothing(watched: Watched) -> bool:
    return not watched.contacts.any()


# In flight


@pytest.mark.slow
@pytest.mark.parametrize("name", EVERY_CHARACTER, ids=character_id)
def test_in_flight_it_holds_for_any_state_and_effort(name: str, watch: Watch) -> None:
    # Arrange: beyond soft limits, too, and with as much passive damping as there is
    whole, free = character(name), 0
    for seed in range(4):
        rng = np.random.default_rng(seed)
        position, velocity = random_state(whole, rng)
        watched = watch(
            name,
            terrain="none",
            initial_position=position.tolist(),
            initial_velocity=velocity.tolist(),
        )
        for _ in range(8):
            # Act
            balance = watched.advance(rng.uniform(-5.0, 5.0, whole.layout.size))

            # Assert
            assert balance.relative < ROUNDING
            free += touches_nothing(watched) and not balance.limited.any()
    assert free >= 3


@pytest.mark.parametrize("name", EVERY_CHARACTER, ids=character_id)
def test_an_effort_that_did_not_act_shows(name: str, watch: Watch) -> None:
    whole, rng = character(name), np.random.default_rng(1)
    watched = watch(name, terrain="none")
    for _ in range(5):
        balance = watched.advance(rng.uniform(-5.0, 5.0, whole.layout.size))
    for entry in np.flatnonzero(~balance.limited).tolist():
        assert watched.run.state.effort is not None
        altered = watched.run.state.effort.copy()
        altered[entry] += 0.01 * balance.largest

        assert watched.balance(effort=altered).relative > NOTICED


def test_a_state_of_another_tick_shows(watch: Watch) -> None:
    watched = watch("humanoid", terrain="none")
    rng = np.random.default_rng(1)
    for _ in range(5):
        watched.advance(rng.uniform(-5.0, 5.0, watched.whole.layout.size))
        after = watched.run.state

        assert watched.balance(position=after.position).relative > 1e4 * ROUNDING
        assert watched.balance(velocity=after.velocity).relative > NOTICED


# On the ground


@pytest.fixture
def box(tmp_path: Path) -> str:
    """A box of 2 kg, 0.2 m high, its centre of mass off its middle."""
    (tmp_path / "box.urdf").write_text(BOX_URDF)
    (tmp_path / "box.yaml").write_text("urdf: box.urdf\ninertia: file\n")
    return str(tmp_path / "box.yaml")


@pytest.mark.parametrize(
    ("position", "velocity"),
    [
        ([0.0, 0.0, 0.1, 0.0, 0.0, 0.0], [0.0] * 6),
        ([0.0, 0.0, 0.1, 0.0, 0.0, 0.0], [3.0, 1.0, 0.0, 0.0, 0.0, 5.0]),
        ([0.0, 0.0, 0.5, 0.5, 0.4, 0.0], [1.0, 0.0, -2.0, 3.0, 4.0, -2.0]),
    ],
    ids=["at rest", "sliding", "tumbling"],
)
def test_it_holds_for_a_box_on_the_ground(
    box: str, watch: Watch, position: list[float], velocity: list[float]
) -> None:
    watched = watch(box, initial_position=position, initial_velocity=velocity)
    touched, of_torque = 0, 0.0
    for _ in range(240):
        balance = watched.advance(np.zeros(6))

        assert balance.relative < ROUNDING
        if touches_nothing(watched):
            continue
        touched += 1
        nothing, forces_alone = (watched.contacts * np.repeat(part, 3) for part in ([0, 0], [1, 0]))
        assert watched.balance(contacts=nothing).relative > NOTICED
        of_torque = max(of_torque, watched.balance(contacts=forces_alone).relative)
    assert touched > 100
    # at rest the torques of four corners cancel
    assert of_torque > NOTICED or not any(velocity)


def test_it_holds_for_a_humanoid_that_stands_and_one_that_lies(watch: Watch) -> None:
    # Arrange: limp after a second of standing; in the end links of its own are on each other
    watched = watch("humanoid")
    driver = controller("humanoid", root_assistance=False)
    standing = []
    for state, effort, _ in run_together(watched.run, driver, 60):
        watched.run.watches_contacts = True
        if standing:
            assert watched.balance().relative < ROUNDING
        standing.append(effort)
        watched.before = state
    assert not touches_nothing(watched)

    for tick in range(480):
        # Act
        balance = watched.advance(np.zeros(watched.whole.layout.size))

        # Assert
        assert balance.relative < ROUNDING
        if tick % 40 == 0 and not touches_nothing(watched):
            nothing = np.zeros_like(watched.contacts)
            assert watched.balance(contacts=nothing).relative > NOTICED


def test_pushes_off_the_centre_of_mass_are_a_part_of_it(watch: Watch) -> None:
    # Arrange: two at once, on a standing humanoid
    watched = watch("humanoid")
    links = [link.name for link in watched.whole.links]
    rng = np.random.default_rng(2)

    def push(name: str) -> ExternalWrench:
        return ExternalWrench(
            links.index(name), rng.uniform(-60, 60, 6), rng.uniform(-0.2, 0.2, 3), 1, 1
        )

    for _ in range(40):
        pushes = push("chest"), push("left_wrist")

        # Act
        balance = watched.advance(np.zeros(watched.whole.layout.size), *pushes)

        # Assert
        assert balance.relative < ROUNDING
        central = tuple(replace(one, point=np.zeros(3)) for one in pushes)
        for wrong in ((), pushes[:1], central):
            assert watched.balance(pushes=wrong).relative > NOTICED


# What no topic carries


def test_what_a_joint_limit_does_is_left_over_on_its_own_entry(watch: Watch) -> None:
    # Arrange: a knee that is straight, its upper limit, and driven further
    watched = watch("humanoid", terrain="none", gravity=0.0)
    watched.equation = EquationOfMotion(watched.whole, 0.0, RATE)
    layout = watched.whole.layout
    knee = layout.dof_names.index("right_knee")
    effort = np.zeros(layout.size)
    effort[knee] = 20.0
    for _ in range(10):
        # Act
        balance = watched.advance(effort)

        # Assert: it takes up all of the effort
        assert balance.relative < ROUNDING
        assert balance.limited[knee]
        assert balance.residual[knee] == pytest.approx(-20.0, rel=0.05)
        assert np.abs(np.delete(balance.residual, knee)).max() < 1e-9


def test_what_spinning_friction_does_is_left_over_as_a_torque_about_the_normal(
    watch: Watch,
) -> None:
    # Arrange: the quadruped's URDF has it at the toes; it turns on the spot
    whole = character("laikago")
    velocity = np.zeros(whole.layout.size)
    velocity[5] = 2.0
    watched = watch("laikago", initial_velocity=velocity.tolist())
    driver, largest = controller("laikago", root_assistance=False), 0.0
    for _ in range(60):
        effort, _ = driver.compute_effort(watched.run.state, watched.run.clock.stamp_ns(1))

        # Act
        balance = watched.advance(np.where(watched.run.simulated.commanded, effort, 0.0))

        # Assert: of the whole body
        turn = rotations.matrix(rotations.exp(watched.before.position[3:6]))
        force, torque = balance.residual[:3], turn @ balance.residual[3:6]
        assert np.abs(force).max() < ROUNDING * balance.largest
        assert np.abs(torque[:2]).max() < 1e-2 * np.abs(torque[2]) + ROUNDING * balance.largest
        largest = max(largest, abs(float(torque[2])))
    assert largest > 1.0


# As it was recorded


@pytest.mark.slow
def test_it_holds_for_what_a_bag_says_of_a_walk(tmp_path: Path) -> None:
    # Arrange
    reference = {"reference": "clip", "clip": "walk"}
    run_plan_here(make_plan("humanoid", 0.5, reference, {}, {}), tmp_path / "walk")
    recording = read_recording(tmp_path / "walk")
    whole = recording.character
    equation = EquationOfMotion(whole, GRAVITY, RATE)
    rows = {link.name: row for row, link in enumerate(whole.links)}
    assert len(recording.effort) == 120

    for tick, touching in enumerate(recording.contacts):
        assert touching is not None
        wrenches = np.zeros((len(whole.links), 6))
        wrenches[[rows[name] for name in touching.links]] = touching.wrenches
        before, velocity = recording.position[tick], recording.velocity[[tick, tick + 1]]

        # Act
        balance = equation.balance(
            before, velocity[0], recording.effort[tick], velocity[1], wrenches
        )

        # Assert: all parts are there, and the ground carries what the assistance does not
        assert balance.relative < ROUNDING
        assert np.linalg.norm(balance.contact) > 0.05 * balance.largest
