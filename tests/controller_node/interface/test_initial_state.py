"""A reset right after a change of the reference begins where the new reference does."""

import pytest
from rclpy.context import Context

from controller_node import parameters as controller
from controller_node.references.factory import make_motion
from msgs_config.messages import topics
from tests.support.physics import character
from tests.support.ros import Processes, SimulatorClient

HUMANOID = character("humanoid")
CLIPS = ("run", "walk") * 5


def begin_of(clip: str) -> list[float]:
    """The position (n,) in which a clip begins."""
    given = {"character": "humanoid", "reference": "clip", "clip": clip}
    values = controller.resolve_for(HUMANOID, given)
    position: list[float] = make_motion(HUMANOID, values).first_state().position.tolist()
    return position


@pytest.mark.slow
def test_a_reset_at_once_begins_at_the_new_reference(
    processes: Processes, context: Context
) -> None:
    client = SimulatorClient(context)
    joints = ["root", *HUMANOID.layout.actuated_joint_names]
    processes.simulator("humanoid", commanded_joints=joints, initial_state="reference")
    processes.controller("humanoid", reference="clip", clip="walk")
    client.spin_until(lambda: client.states.messages, "the first state")

    for clip in CLIPS:
        assert client.set_parameter(topics.CONTROLLER_NODE, "clip", clip) == (True, "")
        before = len(client.states.messages)
        assert client.reset().success
        client.spin_until(
            lambda before=before: any(not m.effort for m in client.states.messages[before:]),
            "the first state of the next episode",
        )
        first = next(m for m in client.states.messages[before:] if not m.effort)
        assert list(first.position) == pytest.approx(begin_of(clip), abs=1e-9)
    client.close()
