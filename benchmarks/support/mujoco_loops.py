"""Plain loops in MuJoCo that hold the same humanoid to the same clip: what a tick must cost."""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

import actuated_characters as ac
from controller_node.planner.contact_model import ContactModel
from controller_node.references.base import ReferenceState
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from sim_node.physics.mujoco.world import MujocoWorld

_PERIOD = 1.0 / 240.0  # s


class MujocoLoop:
    """MuJoCo's own humanoid on the ground, whose root is held as the character's is."""

    def __init__(
        self,
        character: Character,
        reference: Sequence[ReferenceState],
        stiffness: FloatArray,
        damping: FloatArray,
    ) -> None:
        """Of a reference's states, one a tick, and gains (n,)."""
        world = ContactModel(character, period_s=_PERIOD, gravity=9.81, friction=1.0)
        self.model, self.data = world.model, mujoco.MjData(world.model)
        self._positions = [world.position_of(each.configuration.position) for each in reference]
        self._velocities = [each.velocity for each in reference]
        self._stiffness, self._damping = stiffness, damping
        self._mass = np.zeros((self.model.nv, self.model.nv))
        self._error = np.zeros(self.model.nv)
        self._tick = 0
        self.data.qpos[:], self.data.qvel[:] = self._positions[0], self._velocities[0]

    def step(self) -> None:
        """A tick of stable PD in numpy (Tan, Liu and Turk 2011), as one would write it."""
        model, data = self.model, self.data
        self._tick += 1
        mujoco.mj_step1(model, data)
        mujoco.mj_differentiatePos(model, self._error, 1.0, data.qpos, self._positions[self._tick])
        wanted = self._velocities[self._tick] - data.qvel
        known = self._stiffness * (self._error - _PERIOD * data.qvel) + self._damping * wanted
        mujoco.mj_fullM(model, data, self._mass)
        implicit = self._mass + np.diag(_PERIOD * self._damping)
        acceleration = np.linalg.solve(implicit, known - data.qfrc_bias)
        data.qfrc_applied[:] = known - _PERIOD * self._damping * acceleration
        mujoco.mj_step2(model, data)


class ServoLoop(MujocoLoop):
    """The same with MuJoCo's own springs and dampers in the joints, in C; the root is held."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        model = self.model
        first = model.jnt_dofadr
        model.jnt_stiffness[:] = self._stiffness[first]
        model.dof_damping[:] = self._damping
        model.opt.disableflags &= ~int(
            mujoco.mjtDisableBit.mjDSBL_SPRING | mujoco.mjtDisableBit.mjDSBL_DAMPER
        )

    def step(self) -> None:
        """A tick: the springs' rest is the reference."""
        self._tick += 1
        self.model.qpos_spring[:] = self._positions[self._tick]
        mujoco.mj_step(self.model, self.data)


class StepAlone:
    """MuJoCo's own step, in C, of a simulation's world in the states of its walk: no law in it."""

    def __init__(self, controller: ac.Controller, simulation: ac.Simulation, ticks: int) -> None:
        world = simulation._simulation._world
        assert isinstance(world, MujocoWorld)
        self._model, self._data = world.model, mujoco.MjData(world.model)
        self._states = []
        for _ in range(ticks):
            effort = controller.compute_effort(simulation.state)
            self._states.append((world.data.qpos.copy(), world.data.qvel.copy(), effort))
            simulation.step(effort)
        self._tick = 0

    def step(self) -> None:
        """The next tick of the walk, which begins again after its end."""
        data = self._data
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = self._states[self._tick]
        self._tick = (self._tick + 1) % len(self._states)
        mujoco.mj_step(self._model, data)
