"""Gaits: the captured cycles are in them, strides fit speeds, and what is no cycle is rejected."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller_node.references.clip import ClipReference
from controller_node.references.steering.gait import Gait, GaitCycle, cycle_of, standing_cycle
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.clips.reading import read_clip
from msgs_config.errors import ConfigurationError
from msgs_config.geometry import rotations
from tests.support.physics import character

HUMANOID = character("humanoid")
LAYOUT = HUMANOID.layout
REST = LAYOUT.configuration(np.array(HUMANOID.rest_position))


def clip_cycle(name: str) -> GaitCycle:
    frames = read_clip(HUMANOID, name)
    return cycle_of(name, ClipReference(LAYOUT, frames), float(frames.times[-1]), HUMANOID)


WALK, RUN = clip_cycle("walk"), clip_cycle("run")
STANDING = standing_cycle(HUMANOID, WALK)
GAIT = Gait(LAYOUT, [STANDING, WALK, RUN])


def body(speed: float, phase: float) -> GeneralizedPosition:
    return GAIT.at(speed, phase)[0]


def points(pose: GeneralizedPosition) -> FloatArray:
    """The links' origins (l, 3), m, where the root's is on the z axis and it faces along x."""
    position = pose.position.copy()
    position[:2] = 0.0
    turns = pose.orientations_xyzw.copy()
    turns[0] = rotations.multiply(rotations.about_z(-float(rotations.yaw(turns[0]))), turns[0])
    position[LAYOUT.rotation_entries] = rotations.log(turns)
    model = DynamicsModel(HUMANOID, 9.81)
    model.update(position, np.zeros(LAYOUT.size))
    return model.link_poses()[0]


@pytest.mark.parametrize(("name", "cycle"), [("walk", WALK), ("run", RUN)])
def test_at_a_clips_speed_the_poses_are_the_clips(name: str, cycle: GaitCycle) -> None:
    clip = ClipReference(LAYOUT, read_clip(HUMANOID, name))

    for phase in (0.0, 0.2, 0.5, 0.77):
        captured = clip.sample(phase * cycle.period).configuration
        found = body(cycle.speed, phase)
        assert points(found) == pytest.approx(points(captured), abs=0.01)


def test_standing_is_the_rest_pose_at_every_phase() -> None:
    for phase in (0.0, 0.3, 0.99):
        assert points(body(0.0, phase)) == pytest.approx(points(REST), abs=1e-12)


@pytest.mark.parametrize("cycle", [WALK, RUN])
def test_a_cycle_ends_as_it_begins_and_sways_about_its_way(cycle: GaitCycle) -> None:
    first, last = cycle.at(0.0), cycle.at(1.0)

    assert last.position[:3] == pytest.approx(first.position[:3], abs=1e-9)
    apart = rotations.angle_between(first.orientations_xyzw, last.orientations_xyzw)
    assert apart == pytest.approx(0.0, abs=1e-6)
    assert cycle.positions[:-1, :2].mean(axis=0) == pytest.approx(0.0, abs=1e-12)


@given(st.floats(-3.0, 3.0))
def test_stride_times_frequency_is_the_speed(speed: float) -> None:
    frequency = GAIT.frequency(speed)

    strides = np.interp(abs(speed), GAIT.speeds, [0.0, WALK.stride, RUN.stride])
    assert frequency * strides == pytest.approx(speed, abs=1e-12)


@given(st.floats(0.0, 3.5), st.floats(0.0, 0.999))
def test_poses_change_little_with_a_little_speed_or_phase(speed: float, phase: float) -> None:
    here = points(body(speed, phase))

    assert points(body(speed + 1e-4, phase)) == pytest.approx(here, abs=1e-3)
    assert points(body(speed, phase + 1e-4)) == pytest.approx(here, abs=2e-3)


def test_a_clip_on_the_spot_is_rejected_by_name() -> None:
    class Still:
        def sample(self, time: float) -> object:
            return type("State", (), {"configuration": REST})

    with pytest.raises(ConfigurationError, match="clip 'spot' moves by 0 m"):
        cycle_of("spot", Still(), 1.0, HUMANOID)  # type: ignore[arg-type]


def test_cycles_must_rise_in_speed() -> None:
    with pytest.raises(ConfigurationError, match="the clip to run must be faster"):
        Gait(LAYOUT, [STANDING, RUN, WALK])
