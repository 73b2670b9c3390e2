"""One tick of engine MuJoCo, stage by stage, with what each stage finds and how long it takes.

The stages are the lecture's ("Simulating a Character"); their parts are those of MuJoCo's `mj_step`
(its documentation, "Simulation loop"), called one by one.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations

import mujoco
import numpy as np

from actuated_characters.bags.recording import Recording
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.character.mujoco_model import compile_for_contacts
from msgs_config.character.mujoco_world import Contacts, add_character, add_ground, set_options
from msgs_config.compiled.friction import ask_for_friction
from msgs_config.geometry import rotations
from msgs_config.parameters import Values
from sim_node.simulation_factory import make_simulation_settings

STAGES = (
    "collision detection",
    "contact handling",
    "construct equations",
    "solve",
    "update velocity",
    "update position",
)


@dataclass(frozen=True)
class TickStages:
    """What a tick's stages found."""

    seconds: Mapping[str, float]  # s, by stage
    contacts: int  # points where shapes touch
    rows: int  # of the constraint's Jacobian J: three a contact, one a joint at its limit
    iterations: int  # of the solver
    force: float  # N, sum of the contacts' normal forces
    impulse: float  # N s, sum of their normal impulses in this tick
    velocity: FloatArray  # (n,) after it, layout's
    position: FloatArray  # (q,) after it, MuJoCo's: rotations as quaternions wxyz


def pairs_that_may_touch(model: mujoco.MjModel) -> int:
    """How many pairs of shapes may touch: of two bodies that are not fixed to one another."""
    excluded = set(model.exclude_signature.tolist())
    fixed = model.body_weldid.tolist()
    count = 0
    for pair in combinations(model.geom_bodyid.tolist(), 2):
        low, high = sorted(pair)
        count += fixed[low] != fixed[high] and (low << 16) + high not in excluded
    return count


class StagedTick:
    """The world of a run of engine MuJoCo, whose ticks are made again from its messages."""

    def __init__(self, run: Recording) -> None:
        """The world of a run with one character, one substep a tick, and nothing thrown."""
        self._character = run.character
        self.model = _compile(run)
        self._data = mujoco.MjData(self.model)

    def numbers(self, position: FloatArray) -> FloatArray:
        """A position (n,), message form, as MuJoCo has it (q,)."""
        parts = []
        for joint in self._character.layout.joints:
            turn = joint.rotation
            if turn is None:
                parts.append(position[joint.entries])
                continue
            quaternion = rotations.wxyz_from_xyzw(rotations.exp(position[turn]))
            parts += [position[joint.start : turn.start], quaternion]
        return np.concatenate(parts)

    def run(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> TickStages:
        """Advance by one tick from a state (n,) of message form under an effort (n,)."""
        model, data = self.model, self._data
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = self.numbers(position), velocity
        data.qfrc_applied[:] = effort
        calls: Mapping[str, tuple[Callable[[], object], ...]] = {
            "collision detection": (self._find_frames, lambda: mujoco.mj_collision(model, data)),
            "contact handling": (
                lambda: mujoco.mj_makeConstraint(model, data),
                lambda: mujoco.mj_island(model, data),
            ),
            "construct equations": (self._construct,),
            "solve": (self._solve,),
            "update velocity": (self._update_velocity,),
            "update position": (
                lambda: mujoco.mj_integratePos(model, data.qpos, data.qvel, model.opt.timestep),
            ),
        }
        seconds = {}
        for stage in STAGES:
            began = time.perf_counter()
            for call in calls[stage]:
                call()
            seconds[stage] = time.perf_counter() - began
        return self._found(seconds)

    def _find_frames(self) -> None:
        for part in (mujoco.mj_kinematics, mujoco.mj_comPos):
            part(self.model, self._data)

    def _construct(self) -> None:
        """M and its factors, C, and what the constraints resist to."""
        for part in (
            mujoco.mj_makeM,
            mujoco.mj_factorM,
            mujoco.mj_transmission,
            mujoco.mj_projectConstraint,
            mujoco.mj_fwdVelocity,
        ):
            part(self.model, self._data)

    def _solve(self) -> None:
        """Accelerations without constraints, then the constraints' forces and what they change."""
        model, data = self.model, self._data
        mujoco.mj_fwdAcceleration(model, data)
        if data.ncon:  # as engine MuJoCo's world has it
            smooth = np.empty(data.nefc)
            mujoco.mj_mulJacVec(model, data, smooth, data.qacc_smooth)
            contact = data.contact
            ask_for_friction(data.efc_aref, smooth, contact.friction, contact.efc_address)
        mujoco.mj_fwdConstraint(model, data)

    def _update_velocity(self) -> None:
        self._data.qvel += self.model.opt.timestep * self._data.qacc

    def _found(self, seconds: Mapping[str, float]) -> TickStages:
        data = self._data
        first = data.contact.efc_address
        force = float(data.efc_force[first[first >= 0]].sum())
        islands = max(int(data.nisland), 1)
        return TickStages(
            seconds=seconds,
            contacts=int(data.ncon),
            rows=int(data.nefc),
            iterations=int(data.solver_niter[:islands].max()),
            force=force,
            impulse=force * float(self.model.opt.timestep),
            velocity=data.qvel.copy(),
            position=data.qpos.copy(),
        )


def _compile(run: Recording) -> mujoco.MjModel:
    """The model of a run's world, made as the engine makes it."""
    settings = make_simulation_settings(Values(run.parameters))
    assert settings.substeps == 1
    world = settings.world
    friction = world.friction * world.link_friction
    between_links = world.link_friction * world.link_friction
    contacts = Contacts(world.step_s, friction, between_links, world.solver_iterations)
    spec = mujoco.MjSpec()
    spec.compiler.degree = False  # limits are in rad
    set_options(spec.option, contacts, world.gravity)
    add_ground(spec, contacts, plane=world.ground)
    character: Character = run.character
    add_character(spec, "", character, contacts)
    return compile_for_contacts(spec, character.links)
