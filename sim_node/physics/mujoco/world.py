"""MuJoCo's world: the only place that steps it.

The model is compiled when something was added and the world is used again; what was there keeps its
state. A step computes all that depends on the state in which it begins: frames, the mass matrix,
contacts. So positions and velocities are the whole state, and the last step's contacts are there to
be read until the next one.
"""

from collections.abc import Sequence

import mujoco
import numpy as np

from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.model import Character
from msgs_config.errors import ClosedError, SimulationError
from msgs_config.geometry import fixed_order
from msgs_config.messages.throw import ProjectileThrow
from sim_node.physics.engine import UNLIMITED_SPEED
from sim_node.physics.mujoco.balls import MujocoBalls
from sim_node.physics.mujoco.body import MujocoBody
from sim_node.physics.mujoco.contacts import set_friction, sum_contacts
from sim_node.physics.mujoco.model import compile_world
from sim_node.physics.mujoco.part import NOTHING, Part
from sim_node.physics.settings import WorldSettings

_DOWN = np.array((0.0, 0.0, -1.0))
_FULL = (mujoco.mjtWarning.mjWARN_CONTACTFULL, mujoco.mjtWarning.mjWARN_CNSTRFULL)

# MuJoCo would write its warnings into a file where the process runs. Of what is full, `step` says
# it; the others are of states that are not finite, which the simulation finds.
mujoco.set_mju_user_warning(lambda message: None)


class MujocoWorld:
    """The ground and the characters on it, and what is thrown at them, in one MuJoCo model."""

    def __init__(self, settings: WorldSettings) -> None:
        """Make a world without characters.

        Raises:
            CharacterError: the terrain cannot be used.
        """
        self._settings, self._gravity = settings, settings.gravity
        self._bodies: list[MujocoBody] = []
        self.balls = MujocoBalls(self)
        self._is_closed = False
        self._compile()

    def __enter__(self) -> "MujocoWorld":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """End the world; it cannot be used any more, nor what was added to it."""
        self._is_closed = True
        self._model = self._data = None

    def add(self, character: Character, speed_bound: float = UNLIMITED_SPEED) -> MujocoBody:
        """Put a character into the world, at the pose of its URDF.

        No degree of freedom is let be faster than `speed_bound`, rad/s or m/s. Whether MuJoCo takes
        it shows when the world is used.
        """
        self.check_open()
        body = MujocoBody(self, character, speed_bound)
        self._bodies.append(body)
        self.is_outdated = True
        return body

    @property
    def model(self) -> mujoco.MjModel:
        """MuJoCo's model of all that was added.

        Raises:
            CharacterError: it refuses some of that.
            ClosedError: the world is closed.
        """
        self._update()
        return self._model

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's state of all that was added; raises as `model` does."""
        self._update()
        return self._data

    def check_open(self) -> None:
        """Raise ClosedError if it is closed."""
        if self._is_closed:
            raise ClosedError("it is closed: its engine has ended; make a new one")

    def _update(self) -> None:
        """Compile the model again if something was added; what was there keeps its state."""
        self.check_open()
        if self.is_outdated:
            data = self._data
            states = [(part, part.state(data)) for part in self._parts() if part.is_placed]
            self._compile()
            for part, state in states:
                part.restore(self._data, state)

    def _parts(self) -> list[Part]:
        return [*self._bodies, *self.balls.balls]

    def _compile(self) -> None:
        """Compile the model of all that was added, in the state in which each of that begins."""
        characters = [body.character for body in self._bodies]
        model = compile_world(characters, self.balls.throws, self._settings)
        self._model, self._data = model, mujoco.MjData(model)
        place = NOTHING
        for part in self._parts():
            place = part.put_after(place)
        self.is_outdated = False
        """Whether something was added since then."""
        self.set_gravity(self._gravity)
        for ball in self.balls.balls:
            ball.let_go(self._data)
        bounds = np.full(model.nv, UNLIMITED_SPEED)
        for body in self._bodies:
            bounds[body.place.velocities] = body.speed_bound
        self._bounds = bounds if (bounds < UNLIMITED_SPEED).any() else None
        self.pushes: list[tuple[int, FloatArray, FloatArray]] = []
        """Of each push in the next step: MuJoCo's body, wrench (6,) and point (3,) in its link."""
        self._contacts: tuple[FloatArray, BoolArray] | None = None  # None: not asked for yet
        self.forget_frames()

    def set_gravity(self, gravity: float) -> None:
        """Set gravity in m/s^2 along -z."""
        self._gravity = gravity
        self.model.opt.gravity[:] = gravity * _DOWN

    def step(self) -> None:
        """Advance by one engine step; efforts last one step and are to be applied again.

        Raises:
            SimulationError: there are too many contacts, which would all have no force.
        """
        model, data = self.model, self.data
        # The parts of `mj_step`, without its look for numbers out of bounds, of which it writes a
        # file: the simulation looks itself.
        mujoco.mj_fwdPosition(model, data)
        if any(data.warning[each].number for each in _FULL):
            raise SimulationError("more touches at once than the engine 'mujoco' has room for")
        mujoco.mj_fwdVelocity(model, data)
        self._apply_pushes(model, data)
        mujoco.mj_fwdAcceleration(model, data)
        set_friction(model, data)
        mujoco.mj_fwdConstraint(model, data)
        before = data.qpos.copy()
        mujoco.mj_Euler(model, data)
        if self._bounds is not None and (np.abs(data.qvel) > self._bounds).any():
            # The step is gone again with the speeds that are let be.
            np.clip(data.qvel, -self._bounds, self._bounds, out=data.qvel)
            data.qpos[:] = before
            mujoco.mj_integratePos(model, data.qpos, data.qvel, model.opt.timestep)
        data.qfrc_applied[:] = 0.0
        self._contacts = None
        self.forget_frames()

    def _apply_pushes(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        for body, wrench, point in self.pushes:
            at = data.xpos[body] + fixed_order.apply(data.xmat[body].reshape(3, 3), point)
            force, torque = wrench[:3], wrench[3:]
            mujoco.mj_applyFT(model, data, force, torque, at, body, data.qfrc_applied)
        self.pushes.clear()

    def forget_frames(self) -> None:
        """Take note that the state has changed, so that the links' frames are those of before."""
        self._has_frames = False

    def find_frames(self) -> mujoco.MjData:
        """MuJoCo's state with the links' frames of the present positions."""
        data = self.data
        if not self._has_frames:
            self._centres_at_step = data.xipos.copy()
            mujoco.mj_kinematics(self._model, data)
            self._has_frames = True
        return data

    def contacts(self) -> tuple[FloatArray, BoolArray]:
        """Net contact wrench (bodies, 6) of the last step on each of MuJoCo's bodies, as of `Body`.

        And which bodies (bodies,) touched.
        """
        if self._contacts is None:
            centres = self._centres_at_step if self._has_frames else self.data.xipos
            self._contacts = sum_contacts(self.model, self.data, centres)
        return self._contacts

    def heights_below(self, points: FloatArray) -> FloatArray:
        """Height z (r,) in m of the highest surface below each point (r, 3); 0 without one."""
        data = self.find_frames()
        heights = np.zeros(len(points))
        for row, point in enumerate(points):
            distance = mujoco.mj_ray(self.model, data, point, _DOWN, None, True, -1, None)
            if distance >= 0.0:
                heights[row] = point[2] - distance
        return heights

    def to_bytes(self) -> bytes:
        """The whole state, for any world of equal settings, characters and balls."""
        data = self.data
        return b"".join(part.tobytes() for part in (data.qpos, data.qvel))

    def from_bytes(self, state: bytes, throws: Sequence[ProjectileThrow] = ()) -> None:
        """Restore a state of `to_bytes`, exactly, in which there were the balls of `throws`."""
        self.balls.replace(throws)
        data, numbers = self.data, np.frombuffer(state)
        for part in (data.qpos, data.qvel):
            part[:], numbers = numbers[: len(part)], numbers[len(part) :]
        data.qfrc_applied[:] = 0.0
        self.pushes.clear()
        bodies = self.model.nbody  # none touch, until a step says it
        self._contacts = np.zeros((bodies, 6)), np.zeros(bodies, dtype=np.bool_)
        self.forget_frames()
