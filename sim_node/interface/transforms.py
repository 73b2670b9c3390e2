"""`/tf` and `/tf_static` of one character: world, odom, base, and each link of its description."""

from collections.abc import Callable

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.bus.node import BusNode
from msgs_config.character.urdf.described_joints import DescribedJoint, DescribedJoints, pose_rows
from msgs_config.frame_names import WORLD
from msgs_config.geometry import rotations
from msgs_config.messages import topics
from sim_node.frames import FrameNames
from sim_node.interface.transforms_encoder import TransformsEncoder
from sim_node.physics.simulated_character import SimulatedCharacter

_REPETITIONS = 3  # times that a state is published again for a new subscriber
_NO_MOTION = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


class TransformPublisher:
    """Publishes what moves on `/tf`, and the rest once on `/tf_static`."""

    def __init__(
        self,
        node: BusNode,
        character: SimulatedCharacter,
        joints: DescribedJoints,
        frames: FrameNames,
    ) -> None:
        """Offer both topics, and publish the static frames."""
        self._character, self._joints = character, joints
        self._prefix = character.setup.prefix
        self.publisher = node.publisher(topics.TF)
        self._static = node.publisher(topics.TF_STATIC)
        self._subscribers = 0  # their number when the moving frames were published last
        self._repetitions = 0  # how often the state is still to be published again
        self._floats = character.layout.has_floating_base
        base = (self._prefix + frames.odom, self._prefix + joints.root)
        moving = [base] if self._floats else []
        self._encoder = TransformsEncoder(moving + [self._names(each) for each in joints.moving])
        static = [self._names(each) for each in joints.fixed]
        poses = [pose_rows(joints.fixed)]
        if not self._floats:
            static.append(base)
            poses.append(self._base_pose())
        names = {base[1], *(self._prefix + each.child for each in joints.joints)}
        if base[0] != WORLD and WORLD not in names:
            static.append((WORLD, base[0]))
            poses.append(_NO_MOTION[np.newaxis])
        self._static.publish(TransformsEncoder(static).encode(0, np.concatenate(poses)))

    def _names(self, joint: DescribedJoint) -> tuple[str, str]:
        return self._prefix + joint.parent, self._prefix + joint.child

    def _base_pose(self) -> FloatArray:
        """Pose (1, 7) of the base in the world, which is the frame of `odom`."""
        origin, turn = self._character.base_frame()
        turned = rotations.multiply(turn, rotations.conjugate(self._joints.turn_xyzw))
        return np.concatenate((origin, turned))[np.newaxis]

    def publish(self, stamp_ns: int, positions: Callable[[], FloatArray]) -> None:
        """Publish the frames that move, if there are subscribers.

        `positions` gives those (m,) of the description's joints.
        """
        before, self._subscribers = self._subscribers, self._count_subscribers()
        if self._subscribers > before:
            self._repetitions = _REPETITIONS
        if self._subscribers:
            poses = self._joints.poses(positions())
            if self._floats:
                poses = np.concatenate((self._base_pose(), poses))
            self.publisher.publish(self._encoder.encode(stamp_ns, poses))

    def repeat(self, stamp_ns: int, positions: Callable[[], FloatArray]) -> None:
        """Publish again if subscribers have just come, which may have missed it.

        Only then: tf2 warns of a stamp that comes twice.
        """
        if self._repetitions or self._count_subscribers() > self._subscribers:
            self.publish(stamp_ns, positions)
            self._repetitions = max(self._repetitions - 1, 0)

    def _count_subscribers(self) -> int:
        return self.publisher.get_subscription_count()
