"""The benchmark's yardstick computes what it should: in the states of ours, nearly our efforts.

Not more than nearly: its mass matrix is PyBullet's, see docs/design.md.
"""

import numpy as np

from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import make_plan
from controller_node.parameters import make_controller
from msgs_config.character.layout import JointType
from tests.support.engines import need_engine

need_engine("bullet")
from benchmarks.support.deep_mimic import _LARGEST_EFFORTS, DeepMimicStablePd  # noqa: E402

WALK: dict[str, object] = {"reference": "clip", "clip": "walk"}


def test_pybullets_own_stable_pd_gets_our_states_joint_by_joint() -> None:
    walk = list(ticks_in_process(make_plan("humanoid", 0.3, WALK, {}, {})))
    alone = make_plan("humanoid", 0.3, WALK, {}, {"root_assistance": False})
    driver = make_controller(alone.character, alone.reference, alone.controller)
    layout = alone.character.layout
    order = [
        *("chest", "neck", "right_hip", "right_knee", "right_ankle", "right_shoulder"),
        *("right_elbow", "left_hip", "left_knee", "left_ankle", "left_shoulder", "left_elbow"),
    ]
    with DeepMimicStablePd() as theirs:
        for tick in walk[30::20]:
            assert tick.reference is not None
            theirs._set_state(tick.state.position, tick.state.velocity)
            parts = theirs._parts(tick.reference.position)
            desired = [entry for part in parts for entry in part]
            velocity = theirs._desired_velocity(tick.reference.velocity)
            efforts = theirs._law.computePDForces(desired, velocity, _LARGEST_EFFORTS)
            ours, _ = driver.compute_effort(tick.state, walk[0].state.stamp_ns)

            found, start = np.zeros(layout.size), 7
            for name in order:
                joint = layout.joint(name)
                is_ball = joint.type is JointType.SPHERICAL
                found[joint.entries] = efforts[start : start + (3 if is_ball else 1)]
                start += 4 if is_ball else 1
            assert np.abs(ours[6:]).max() > 15.0
            np.testing.assert_allclose(found[6:], ours[6:], rtol=0.0, atol=1.0)
