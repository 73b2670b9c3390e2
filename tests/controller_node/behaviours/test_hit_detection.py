"""Hits told from contacts: none in any clip, each of 5 N s, and of what size they are."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller_node.behaviours.bounding_spheres import BoundingSpheres
from controller_node.behaviours.hit_detection import HitDetector, beyond_cone
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import ROOT
from msgs_config.clips.reading import available_clips, read_clip
from msgs_config.parameters import resolve
from sim_node import parameters as for_simulator
from sim_node.simulation_factory import make_character_setup, make_simulation_settings
from tests.support.physics import LoneSimulation, run_together
from tests.support.struck import HUMANOID, LINKS, RATE_HZ, ProjectileThrow, driver, run

THRESHOLD = 3.0  # N s, the default
CHEST = LINKS.index("chest")
MODEL = DynamicsModel(HUMANOID)
STANDING = np.array(HUMANOID.rest_position)
FRICTION = 0.9
LONGER = 0.5  # s that a clip is watched beyond its end, which is its wrap


class Watch:
    """A detector, and the frames of the links that it needs."""

    def __init__(self) -> None:
        self._detector = HitDetector(HUMANOID, 1.0 / RATE_HZ)

    def impulse(self, contacts: FloatArray, position: FloatArray = STANDING) -> float:
        """The impulse of the window that ends with these contacts, N s."""
        MODEL.update(position, np.zeros(HUMANOID.layout.size))
        hit = self._detector.strongest(contacts, *MODEL.link_poses())
        return 0.0 if hit is None else hit.impulse


def contacts(**forces: tuple[float, float, float]) -> FloatArray:
    wrenches = np.zeros((len(LINKS), 6))
    for name, force in forces.items():
        wrenches[LINKS.index(name), :3] = force
    return wrenches


def clip_run(clip: str) -> LoneSimulation:
    """The humanoid where a clip begins, assisted."""
    start = driver({"clip": clip})._own_reference.sample(0.0)
    values = resolve(
        for_simulator.PARAMETERS + for_simulator.character_parameters(HUMANOID),
        {
            "commanded_joints": [ROOT, *HUMANOID.layout.actuated_joint_names],
            "initial_position": start.configuration.position.tolist(),
            "initial_velocity": start.velocity.tolist(),
        },
    )
    setup = make_character_setup(HUMANOID, values)
    simulation = LoneSimulation(setup, make_simulation_settings(values))
    simulation.watches_contacts = True
    return simulation


@pytest.mark.slow
@pytest.mark.parametrize("clip", available_clips(HUMANOID))
def test_no_clip_hits_itself(clip: str) -> None:
    # Arrange
    watch, largest, touched = Watch(), 0.0, 0
    ticks = round((read_clip(HUMANOID, clip).times[-1] + LONGER) * RATE_HZ)
    with clip_run(clip) as simulation:
        # Act
        for current, _, _ in run_together(simulation, driver({"clip": clip}), ticks):
            assert simulation.simulated.contacts is not None
            wrenches = simulation.simulated.contacts.wrenches
            largest = max(largest, watch.impulse(wrenches, current.position))
            touched += bool(wrenches.any())

    # Assert
    assert touched > ticks / 10  # there were contacts to be told from hits
    assert largest < 0.5 * THRESHOLD


@pytest.mark.parametrize("direction", [0.0, np.pi])
def test_a_ball_is_detected_with_the_momentum_that_it_loses(direction: float) -> None:
    # Arrange, Act: nothing but the ball touches anything above the feet
    mass, speed = 0.5, 10.0
    struck = run(
        {"clip": "walk"}, 60, (ProjectileThrow(speed, 40, direction=direction),), mass=mass
    )

    # Assert
    watch = Watch()
    impulses = [
        watch.impulse(wrenches, position)
        for wrenches, position in zip(struck.contacts, struck.positions, strict=False)
    ]
    momentum = mass * (struck.ball_velocities[40] - struck.ball_velocities[-1])[:2]
    assert max(impulses) == pytest.approx(np.linalg.norm(momentum), rel=0.05)
    assert max(impulses) > THRESHOLD
    assert max(impulses[:40]) == 0.0


def test_what_the_ground_can_do_is_no_hit() -> None:
    assert Watch().impulse(contacts(right_ankle=(300.0, 0.0, 450.0))) == 0.0


def test_what_the_ground_cannot_do_is_one() -> None:
    drawn = Watch().impulse(contacts(right_ankle=(0.0, 0.0, -2400.0)))
    shoved = Watch().impulse(contacts(right_ankle=(2400.0, 0.0, 0.0)))

    assert drawn == pytest.approx(10.0)
    # the distance of (1, 0) from the line of slope 1 / friction
    assert shoved == pytest.approx(10.0 / np.sqrt(1.0 + FRICTION**2))


def test_the_ground_is_not_held_for_what_happens_far_above_it() -> None:
    assert Watch().impulse(contacts(chest=(0.0, 0.0, 2400.0))) == pytest.approx(10.0)


def test_legs_that_touch_each_other_are_no_hit() -> None:
    together = STANDING.copy()
    for side, sign in (("right", 1.0), ("left", -1.0)):
        together[HUMANOID.layout.joint(f"{side}_hip").start] = sign * 0.25
    forces = contacts(right_knee=(0.0, 2400.0, 0.0), left_knee=(0.0, -2400.0, 0.0))

    apart = [Watch().impulse(forces, STANDING), Watch().impulse(forces, together)]

    assert sorted(apart) == pytest.approx([0.0, 20.0])  # of legs apart, two hits


def test_a_hit_is_the_sum_over_the_window_and_then_over() -> None:
    watch = Watch()
    blow, nothing = contacts(chest=(720.0, 0.0, 0.0)), contacts()

    impulses = [watch.impulse(blow), watch.impulse(blow)]
    impulses += [watch.impulse(nothing) for _ in range(4)]

    assert impulses == pytest.approx([3.0, 6.0, 6.0, 6.0, 3.0, 0.0])


forces_3 = st.tuples(*[st.floats(-1e3, 1e3)] * 3).map(np.array)


@given(forces_3)
def test_beyond_the_cone_is_the_shortest_way_out_of_it(force: FloatArray) -> None:
    rest = beyond_cone(force, FRICTION, np.array((0.0, 0.0, 1.0)))
    nearest = force - rest

    # the projection on a closed convex cone (Moreau 1962): in it, at right angles to the rest,
    # which is in the polar cone
    slack = 1e-9 * (1.0 + np.abs(force).max())
    assert np.hypot(nearest[0], nearest[1]) <= FRICTION * nearest[2] + slack
    assert abs(nearest @ rest) <= slack * (1.0 + np.abs(force).max())
    assert FRICTION * np.hypot(rest[0], rest[1]) + rest[2] <= slack


def test_the_spheres_of_a_standing_humanoid_reach_from_its_soles_to_its_head() -> None:
    MODEL.update(STANDING, np.zeros(HUMANOID.layout.size))
    hull = BoundingSpheres(HUMANOID)
    lowest = hull.lowest(hull.centres(*MODEL.link_poses()))

    feet = [LINKS.index(foot) for foot in HUMANOID.feet]
    assert lowest[feet] == pytest.approx(0.0, abs=0.03)  # a box's spheres are wider than it is
    assert np.delete(lowest, feet).min() > 0.05
    assert lowest[LINKS.index("neck")] > 1.2
