"""PyBullet's own stable PD of the humanoid, in Python, from its wheel; put into states of ours."""

import sys
import time
from collections.abc import Sequence
from importlib import import_module
from importlib.util import find_spec, module_from_spec
from pathlib import Path
from types import ModuleType

import pybullet_data

from actuated_characters.metrics.run_metrics import Tick
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointType
from msgs_config.character.loading import load_character
from msgs_config.geometry import rotations
from sim_node.physics.bullet.c_library import captured_output
from sim_node.physics.bullet.client import pybullet

_DATA = Path(pybullet_data.getDataPath())
_LARGEST_EFFORTS = [0.0] * 7 + [1e3] * 36  # a floating base, then ball joints as quaternions
_UPRIGHT_BACK = rotations.conjugate(rotations.ABOUT_X_QUARTER_TURN_XYZW)  # DeepMimic is y-up


def _deep_mimic(name: str) -> ModuleType:
    """A module of theirs, without what their package imports for other things than this."""
    package = find_spec("pybullet_envs")
    assert package is not None
    sys.modules.setdefault(package.name, module_from_spec(package))
    return import_module(f"{package.name}.deep_mimic.env.{name}")


class DeepMimicStablePd:
    """A separate engine with their humanoid, for `with`."""

    def __init__(self) -> None:
        self._layout = load_character("humanoid").layout
        client = import_module("pybullet_utils.bullet_client")
        self._client = client.BulletClient(connection_mode=pybullet.DIRECT)
        self._client.setAdditionalSearchPath(str(_DATA))
        motion = _deep_mimic("motion_capture_data").MotionCaptureData()
        motion.Load(str(_DATA / "data/motions/humanoid3d_walk.txt"))
        with captured_output():  # DeepMimic prints a lot
            self._law = _deep_mimic("humanoid_stable_pd").HumanoidStablePD(
                self._client, motion, 1.0 / 240.0, useFixedBase=False
            )
        self._joints = self._law._jointIndicesAll
        names = [
            self._client.getJointInfo(self._law._sim_model, index)[1].decode()
            for index in self._joints
        ]
        self._in_their_order = [self._layout.joint(name) for name in names]

    def __enter__(self) -> "DeepMimicStablePd":
        return self

    def __exit__(self, *error: object) -> None:
        self._client.disconnect()

    def duration_us(self, ticks: Sequence[Tick]) -> float:
        """Mean processor time in µs of one effort, over the states and references of ticks."""
        total = 0.0
        for tick in ticks:
            assert tick.reference is not None
            self._set_state(tick.state.position, tick.state.velocity)
            desired = [entry for part in self._parts(tick.reference.position) for entry in part]
            velocity = self._desired_velocity(tick.reference.velocity)
            started = time.process_time()
            self._law.computePDForces(desired, velocity, _LARGEST_EFFORTS)
            total += time.process_time() - started
        return 1e6 * total / len(ticks)

    def _set_state(self, position: FloatArray, velocity: FloatArray) -> None:
        origin, turn, *positions = self._parts(position)
        linear, angular, *velocities = self._velocity_parts(velocity)
        body = self._law._sim_model
        self._client.resetBasePositionAndOrientation(body, origin, turn)
        self._client.resetBaseVelocity(body, linear, angular)
        self._client.resetJointStatesMultiDof(body, self._joints, positions, velocities)

    def _parts(self, position: FloatArray) -> list[list[float]]:
        """Origin and quaternion of the base, then each joint's angle or quaternion."""
        origin = rotations.rotate(_UPRIGHT_BACK, position[:3])
        turn = rotations.multiply(_UPRIGHT_BACK, rotations.exp(position[3:6]))
        parts = [origin.tolist(), turn.tolist()]
        for joint in self._in_their_order:
            values = position[joint.entries]
            is_ball = joint.type is JointType.SPHERICAL
            parts.append((rotations.exp(values) if is_ball else values).tolist())
        return parts

    def _velocity_parts(self, velocity: FloatArray) -> list[list[float]]:
        return [velocity[:3].tolist(), velocity[3:6].tolist()] + [
            velocity[joint.entries].tolist() for joint in self._in_their_order
        ]

    def _desired_velocity(self, velocity: FloatArray) -> list[float]:
        """With an entry more, zero, for each quaternion."""
        flat: list[float] = []
        for index, part in enumerate(self._velocity_parts(velocity)):
            flat += [*part, 0.0] if len(part) == 3 and index > 0 else part
        return flat
