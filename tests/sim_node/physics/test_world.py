"""The world repeats itself to the bit, and its physics is what its settings say."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from msgs_config.arrays import FloatArray
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character
from msgs_config.messages.throw import ProjectileThrow
from sim_node.physics.engine import make_world
from sim_node.physics.settings import WorldSettings
from tests.support.physics import (
    LoneWorld,
    advance,
    box_character,
    character,
    kinetic_energy,
)

pytestmark = pytest.mark.usefixtures("engine")

SIZE = character("humanoid").layout.size
WELDED_BASE = """
  <link name="handle">
    <inertial>
      <mass value="0.001"/>
      <inertia ixx="1e-6" iyy="1e-6" izz="1e-6" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <joint name="weld" type="fixed"><parent link="handle"/><child link="box"/></joint>
</robot>"""


def flat_box(tmp_path: Path, is_base: bool) -> Character:
    """A flat box of 2 kg, 1 m wide: a base link, or welded below a base of next to no mass."""
    box = box_character(tmp_path, "1 1 0.2")
    if is_base:
        return box
    urdf = box.loading.urdf_path
    urdf.write_text(urdf.read_text().replace("</robot>", WELDED_BASE))
    return load_character(str(box.file))


def fallen_humanoid(settings: WorldSettings | None = None) -> LoneWorld:
    """The humanoid half a second after its joints went limp: it slumps onto itself."""
    world = LoneWorld(character("humanoid"), settings or WorldSettings())
    world.body.set_state(np.array(character("humanoid").rest_position), np.zeros(SIZE))
    advance(world, np.zeros(SIZE), 120)
    return world


def wriggling(seed: int) -> Callable[[], FloatArray]:
    """Random efforts in every joint, the same ones for the same seed."""
    rng = np.random.default_rng(seed)
    motors = np.concatenate((np.zeros(6), np.ones(SIZE - 6)))
    return lambda: 2.0 * motors * rng.normal(size=SIZE)


def trajectory(world: LoneWorld, effort: Callable[[], FloatArray], steps: int) -> bytes:
    """Every bit of the states that follow."""
    states = []
    for _ in range(steps):
        advance(world, effort())
        states += [part.tobytes() for part in world.body.read()]
    return b"".join(states)


# --- repeatable ----------------------------------------------------------------------------------


def test_a_restored_state_remembers_nothing_of_what_was_done_in_between() -> None:
    with fallen_humanoid() as world:
        saved = world.to_bytes()
        first = trajectory(world, wriggling(1), 240)

        thrown = np.array(character("humanoid").rest_position)
        thrown[2] = 5.0
        world.body.set_state(thrown, wriggling(2)())
        trajectory(world, wriggling(3), 100)
        world.from_bytes(saved)
        second = trajectory(world, wriggling(1), 240)

    assert second == first


def test_nothing_touches_from_a_restored_state_on_until_the_next_step() -> None:
    """Not what led to the state, and not what led to the one before it was restored."""
    with fallen_humanoid() as world:
        saved = world.to_bytes()
        advance(world, np.zeros(SIZE))
        next_one = world.body.contact_wrenches()

        world.from_bytes(saved)
        wrenches, touching = world.body.contact_wrenches()
        advance(world, np.zeros(SIZE))
        again = world.body.contact_wrenches()

    assert not wrenches.any() and not touching.any()
    assert next_one[1].any()
    np.testing.assert_array_equal(again[0], next_one[0])
    np.testing.assert_array_equal(again[1], next_one[1])


@pytest.mark.parametrize("threshold", [0.02, 0.3])
def test_two_worlds_at_once_do_not_disturb_each_other(threshold: float) -> None:
    with fallen_humanoid() as alone:
        expected = trajectory(alone, wriggling(1), 60)
    others = WorldSettings(contact_breaking_threshold=threshold)
    with fallen_humanoid() as one, fallen_humanoid(others) as other:
        effort, disturbance = wriggling(1), wriggling(2)

        steps = []
        for _ in range(60):
            steps.append(trajectory(one, effort, 1))
            trajectory(other, disturbance, 1)

    assert b"".join(steps) == expected


def life(before_each: Callable[[], None]) -> bytes:
    """Every bit of what becomes of a humanoid that falls, is moved, thrown at and restored."""
    before_each()
    world = LoneWorld(character("humanoid"), WorldSettings())
    states, effort = [], wriggling(1)
    with world:
        before_each()
        world.body.set_state(np.array(character("humanoid").rest_position), np.zeros(SIZE))
        for tick in range(240):
            before_each()
            if tick == 40:
                world.balls.add(ProjectileThrow(2.0, 0.1, (1.0, 0.0, 1.0), (-9.0, 0.0, 1.0)))
            elif tick == 100:
                world.body.set_motion(*world.body.read())
            elif tick == 110:
                saved, balls = world.to_bytes(), world.balls.throws
            elif tick == 130:
                world.balls.place(0, (0.0, 0.0, 1.0))
            elif tick == 160:
                world.from_bytes(saved, balls)
            before_each()
            advance(world, effort())
            wrenches, _ = world.body.contact_wrenches()
            states += [part.tobytes() for part in (*world.body.read(), wrenches)]
    return b"".join(states)


@pytest.mark.parametrize("threshold", [0.1, 0.3])
def test_what_other_worlds_did_before_in_the_process_does_not_matter(threshold: float) -> None:
    alone = life(lambda: None)
    with LoneWorld(character("pendulum"), WorldSettings(contact_breaking_threshold=threshold)) as w:
        among_others = life(lambda: advance(w, np.zeros(1)))

    assert among_others == alone


# --- physics -------------------------------------------------------------------------------------


@pytest.mark.parametrize("step_s", [1.0 / 240.0, 1.0 / 1000.0])
@pytest.mark.parametrize("gravity", [0.0, 1.62, 9.81])
def test_a_step_is_one_step_of_the_length_and_the_gravity_that_were_set(
    step_s: float, gravity: float
) -> None:
    with LoneWorld(character("lift"), WorldSettings(step_s=step_s, gravity=gravity)) as world:
        world.body.set_state(np.zeros(1), np.array([0.25]))

        advance(world, np.zeros(1))
        (height,), (speed,) = world.body.read()

    assert speed == pytest.approx(0.25 - gravity * step_s, abs=1e-14)
    assert height == pytest.approx(step_s * speed, abs=1e-14)


@pytest.mark.parametrize("is_base", [True, False], ids=["base", "link"])
@pytest.mark.parametrize(("ground", "link"), [(0.0, 0.5), (0.3, 0.9), (0.9, 0.3), (0.6, 0.6)])
def test_a_sliding_box_is_slowed_by_its_friction_times_the_grounds(
    tmp_path: Path, ground: float, link: float, is_base: bool
) -> None:
    box = flat_box(tmp_path, is_base)
    settings = WorldSettings(step_s=1e-3, friction=ground, link_friction=link)
    with LoneWorld(box, settings) as world:
        start = np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0])
        world.body.set_state(start, np.zeros(6))
        advance(world, np.zeros(6), 200)  # it comes to rest on the ground
        position, _ = world.body.read()
        world.body.set_state(position, np.array([2.0, 0.0, 0.0, 0.0, 0.0, 0.0]))

        advance(world, np.zeros(6), 200)
        _, velocity = world.body.read()

    assert velocity[0] == pytest.approx(2.0 - ground * link * 9.81 * 0.2, abs=0.02)


def test_a_box_rests_on_the_ground_at_z_zero(tmp_path: Path) -> None:
    box = flat_box(tmp_path, is_base=True)
    with LoneWorld(box, WorldSettings()) as world:
        world.body.set_state(np.array([0.0, 0.0, 0.3, 0.0, 0.0, 0.0]), np.zeros(6))

        advance(world, np.zeros(6), 480)

        assert world.body.read()[0][2] == pytest.approx(0.1, abs=2e-3)
        assert kinetic_energy(world.body, box) < 1e-6


@pytest.mark.parametrize("faces", ["f 1 2 3 4", "f 1 2 3\no other\nf 1 3 4"], ids=["one", "two"])
def test_a_flat_mesh_collides(tmp_path: Path, faces: str) -> None:
    """A sheet falls onto the ground, and a box onto the sheet: not through it."""
    (tmp_path / "sheet.obj").write_text(f"v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n{faces}\n")
    box = box_character(tmp_path, "0.4 0.4 0.2")
    sheet = box_character(tmp_path, "1 1 1", name="sheet")
    urdf = sheet.loading.urdf_path
    urdf.write_text(urdf.read_text().replace('<box size="1 1 1"/>', '<mesh filename="sheet.obj"/>'))
    sheet = load_character(str(sheet.file))
    with make_world(WorldSettings()) as world:
        heights = {world.add(sheet): 0.05, world.add(box): 0.3}
        for body, height in heights.items():
            body.set_state(np.array([0.0, 0.0, height, 0.0, 0.0, 0.0]), np.zeros(6))
        for _ in range(480):
            for body in heights:
                body.apply(np.zeros(6))
            world.step()
        on_ground, on_sheet = (float(body.read()[0][2]) for body in heights)

    assert on_ground == pytest.approx(0.0, abs=3e-3)
    assert on_sheet == pytest.approx(0.1, abs=5e-3)
