"""The model of the dynamics on both sides of the loop: MuJoCo behind one class."""

from typing import Any

import mujoco
import numpy as np

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.model import Character
from msgs_config.character.mujoco_model import add_links, compile_exactly, quaternion_starts
from msgs_config.compiled import dynamics as compiled
from msgs_config.geometry import fixed_order, rotations

_GRAVITY = 9.81
_NONE: FloatArray = np.empty(0)
_OF_THE_DATA = ("_qpos", "_qvel", "_mass", "parts", "view")  # attributes that a copy makes anew


class DynamicsModel:
    """Mass matrix `M` and bias force `C` of `M dv/dt + C = f`, in the layout's coordinates.

    MuJoCo's velocities and forces are the layout's own; only its positions differ, in that a
    rotation is a quaternion (wxyz) there.
    """

    def __init__(self, character: Character, gravity: float = _GRAVITY) -> None:
        """Build the model of a character under a gravity in m/s^2 along -z."""
        self._layout = character.layout
        self._model = _compile(character, gravity)
        self._data = mujoco.MjData(self._model)
        self._mass_matrix = np.zeros((self._layout.size, self._layout.size))
        self._damping = character.passive_damping()
        self._is_damped = bool(self._damping.any())
        self._armature = character.armature()
        self._coupling = character.coupling.rows(self._layout.size) if character.coupling else None
        # M is stored by rows of its lower triangle, the diagonal last
        self._diagonal = (self._model.M_rowadr + self._model.M_rownnz - 1).astype(np.intp)
        # no position at all: no distance, no angle, and as quaternions (wxyz) no turn
        self._identity = np.zeros(self._model.nq)
        self._identity[quaternion_starts(self._model)] = 1.0
        self._start, self._desired = self._identity.copy(), self._identity.copy()
        self._find_views()

    def __getstate__(self) -> dict[str, object]:
        return {name: value for name, value in self.__dict__.items() if name not in _OF_THE_DATA}

    def __setstate__(self, attributes: dict[str, object]) -> None:
        self.__dict__ |= attributes
        self._find_views()  # a copy needs views of its own data

    def _find_views(self) -> None:
        self._qpos, self._qvel, self._mass = self._data.qpos, self._data.qvel, self._data.M
        self.parts = compiled.DynamicsParts(
            self._model._address,
            self._data._address,
            self._qpos,
            self._qvel,
            self._mass,
            self._diagonal,
            self._identity,
            self._desired,
            self._damping,
        )
        self.view = compiled.make_view(*self.parts)
        """What compiled code has of it; neither is to be kept longer than the model."""

    def update(self, position: FloatArray, velocity: FloatArray) -> None:
        """Take over a state: position (n,), message form, and velocity (n,)."""
        try:
            compiled.take_state(self.view, position, velocity)
        except TypeError:  # it takes doubles alone, and others would be asked for at each tick
            compiled.take_state(self.view, *_doubles(position, velocity))

    @property
    def is_coupled(self) -> bool:
        """Whether some joints follow others."""
        return self._coupling is not None

    def stable_pd(
        self,
        position: FloatArray,
        velocity: FloatArray,
        desired: FloatArray,
        desired_velocity: FloatArray,
        stiffness: FloatArray,
        damping: FloatArray,
        period: float,
        offset: FloatArray | None = None,
        feedforward: FloatArray | None = None,
    ) -> FloatArray:
        """The effort (n,) of stable PD in a state, which is taken over, where no joint follows.

        It is `controller_node.control_laws.stable_pd_effort` in one compiled call, with its bits:
        of position and velocity (n,), those that are desired at the end of a period in s (n,), and
        gains (n,). An offset (n,) is added to the errors, a feedforward effort (n,) to the law's.
        """
        given = (
            *(position, velocity, desired, desired_velocity, stiffness, damping),
            _NONE if offset is None else offset,
            _NONE if feedforward is None else feedforward,
        )
        effort: FloatArray
        try:
            effort = compiled.stable_pd(self.view, *given, period)
        except TypeError:  # likewise
            effort = compiled.stable_pd(self.view, *_doubles(*given, period))
        return effort

    def compute_error(self, position: FloatArray, desired: FloatArray) -> FloatArray:
        """Error (n,) from a position (n,) to a desired one (n,): `JointLayout.difference`, sooner.

        It is the velocity, and so a rotation's part is in the child frame, that leads there in 1 s.
        """
        self._convert(position, self._start)
        return self._difference(self._start, desired)

    def error_of_state(self, desired: FloatArray) -> FloatArray:
        """The error (n,) from the position taken over to a desired one (n,)."""
        return self._difference(self._qpos, desired)

    def _difference(self, start: FloatArray, desired: FloatArray) -> FloatArray:
        """The difference (n,) from a position as MuJoCo has it to one (n,) in message form."""
        difference: FloatArray = np.empty(self._layout.size)
        self._convert(desired, self._desired)
        mujoco.mj_differentiatePos(self._model, difference, 1.0, start, self._desired)
        return difference

    def _convert(self, position: FloatArray, qpos: FloatArray) -> None:
        """Write a position (n,), message form, as MuJoCo has it.

        It is where the velocity of the same numbers leads to in 1 s, from no position at all.
        """
        qpos[:] = self._identity
        mujoco.mj_integratePos(self._model, qpos, position, 1.0)

    def mass_matrix(self) -> FloatArray:
        """The mass matrix M (n, n) at the state taken over: kg, kg m, kg m^2."""
        mujoco.mj_fullM(self._model, self._data, self._mass_matrix)
        return self._mass_matrix.copy()

    def solve(
        self,
        force: FloatArray,
        added: FloatArray,
        period: float,
        rate: FloatArray | float = 0.0,
    ) -> FloatArray:
        """The acceleration `a` (n,) of `(M + D h + diag(added)) a = force` over a period h in s.

        The passive damping D is then that of the velocity at the period's end, and followers
        accelerate as their leaders do, by an effort that does no work (`J a` is `rate`, with the J
        of `Coupling.rows`). The factorisation `L' D L` follows the tree of the links (Featherstone
        2008, section 6.5), and uses no BLAS.
        """
        self._factorise(added, period)
        acceleration: FloatArray = np.empty(self._layout.size)
        mujoco.mj_solveM(self._model, self._data, acceleration[np.newaxis], force[np.newaxis])
        if self._coupling is None:
            return acceleration
        return acceleration + self._coupled(fixed_order.apply(self._coupling, acceleration) - rate)

    def _factorise(self, added: FloatArray | float, period: float) -> None:
        """Factorise `M + D h + diag(added)` over a period h in s."""
        mass, diagonal = self._mass, self._diagonal
        without = mass.take(diagonal)
        if self._is_damped:
            added = period * self._damping + added
        mass.put(diagonal, without + added)
        mujoco.mj_factorM(self._model, self._data)
        mass.put(diagonal, without)

    def coupling_correction(self, violation: FloatArray, period: float) -> FloatArray:
        """The change (n,) of a velocity that takes a violation J v (k,) of the coupling away.

        In the position taken over: `-M^-1 J^T (J M^-1 J^T)^-1 J v`, which impulses between leaders
        and followers lead to. It takes kinetic energy alone (Gauss' principle; Udwadia and Kalaba
        1992). As of a violation of positions. To M counts D h of a period h in s, as in `solve`.
        """
        self._factorise(0.0, period)
        return self._coupled(violation)

    def _coupled(self, violation: FloatArray) -> FloatArray:
        """`coupling_correction` with the mass matrix that was factorised last."""
        rows = self._coupling
        assert rows is not None
        responses = np.empty_like(rows)
        mujoco.mj_solveM(self._model, self._data, responses, rows)
        delassus = fixed_order.product(rows, responses.T)
        impulses = fixed_order.solve(delassus, violation[:, np.newaxis])[:, 0]
        correction: FloatArray = -fixed_order.apply(responses.T, impulses)
        return correction

    def delassus_matrix(self, rows: FloatArray) -> FloatArray:
        """`J M^-1 J^T` (m, m) of rows J (m, n): how the force on each row accelerates each.

        In the position taken over; without passive damping (Brogliato 2016, "Nonsmooth Mechanics").
        """
        accelerations = np.empty_like(rows)
        mujoco.mj_factorM(self._model, self._data)
        mujoco.mj_solveM(self._model, self._data, accelerations, rows)
        return fixed_order.product(rows, accelerations.T)

    def bias_force(self) -> FloatArray:
        """The bias force C (n,) at the state taken over.

        Coriolis, centrifugal and gravity, and what the joints' passive damping takes.
        """
        bias = np.zeros(self._layout.size)
        mujoco.mj_rne(self._model, self._data, 0, bias)
        if self._is_damped:
            bias += self._damping * self._qvel
        return bias

    def inverse_dynamics(self, acceleration: FloatArray) -> FloatArray:
        """The effort (n,) of an acceleration (n,) in the state taken over: `M dv/dt + C`."""
        effort = np.empty(self._layout.size)
        self._data.qacc[:] = acceleration
        mujoco.mj_rne(self._model, self._data, 1, effort)
        effort += self._damping * self._qvel
        if self._armature.any():  # the recursion of MuJoCo knows links alone
            effort += self._armature * acceleration
        return effort

    def gravity_force(self) -> FloatArray:
        """The part of the bias force that is gravity's (n,): the effort that holds it still."""
        data = self._data
        velocity = data.qvel.copy()
        data.qvel[:] = 0.0
        mujoco.mj_comVel(self._model, data)
        force = np.empty(self._layout.size)
        mujoco.mj_rne(self._model, data, 0, force)
        data.qvel[:] = velocity
        mujoco.mj_comVel(self._model, data)
        return force

    def kinetic_energy(self) -> float:
        """Kinetic energy of the state taken over, J."""
        velocity = self._data.qvel
        momentum = fixed_order.apply(self.mass_matrix(), velocity)
        return 0.5 * float(fixed_order.dot(velocity, momentum))

    def link_poses(self) -> tuple[FloatArray, FloatArray]:
        """Origins (links, 3) in m, quaternions xyzw (links, 4) of the link frames in the world."""
        return self._data.xpos[1:].copy(), rotations.xyzw_from_wxyz(self._data.xquat[1:])

    def link_jacobian(self, link: int) -> FloatArray:
        """The Jacobian J (6, n) of one link: `(velocity, angular velocity) = J v`, world axes.

        The velocity (m/s) is that of the link's centre of mass; `link` is an index of
        `Character.links`. A wrench (6,) at the centre of mass is the generalised force `J^T w`.
        """
        jacobian = np.empty((6, self._layout.size))
        mujoco.mj_jacBodyCom(self._model, self._data, jacobian[:3], jacobian[3:], link + 1)
        return jacobian

    def link_drift(self, link: int) -> FloatArray:
        """The acceleration (6,) of a link whose joints and root do not accelerate: `J' v`.

        As of `link_jacobian`: m/s^2 of its centre of mass and rad/s^2, world axes.
        """
        rate, point = np.empty((6, self._layout.size)), self._data.xipos[link + 1]
        mujoco.mj_jacDot(self._model, self._data, rate[:3], rate[3:], point, link + 1)
        return fixed_order.apply(rate, self._data.qvel)

    @property
    def weight(self) -> float:
        """Weight of all links together, N."""
        return float(-self._model.opt.gravity[2] * self._model.body_subtreemass[1])

    @property
    def mass(self) -> float:
        """Mass of all links together, kg."""
        return float(self._model.body_subtreemass[1])

    def subtree(self, link: int) -> tuple[FloatArray, float]:
        """Centre of mass (3,) in the world, m, and mass, kg, of a link and all that it carries.

        `link` is an index of `Character.links`.
        """
        body = link + 1
        return self._data.subtree_com[body].copy(), float(self._model.body_subtreemass[body])

    def inertia_of_entries(self) -> FloatArray:
        """The diagonal (n,) of the mass matrix at the state taken over: kg, kg m^2."""
        diagonal: FloatArray = self._mass.take(self._diagonal)
        return diagonal

    def centre_of_mass(self) -> FloatArray:
        """Centre of mass (3,) of all links in the world, m."""
        centre: FloatArray = self._data.subtree_com[1].copy()
        return centre

    def centre_of_mass_at(self, position: FloatArray) -> FloatArray:
        """Centre of mass (3,) in the world, m, of a position (n,), in which the model then is."""
        self.update(position, np.zeros(self._layout.size))
        return self.centre_of_mass()

    def centre_of_mass_jacobian(self) -> FloatArray:
        """The Jacobian J (3, n) of the centre of mass: its velocity in the world is `J v`, m/s."""
        jacobian = np.empty((3, self._layout.size))
        mujoco.mj_jacSubtreeCom(self._model, self._data, jacobian, 1)
        return jacobian

    def centre_of_mass_velocity(self) -> FloatArray:
        """Velocity (3,) of the centre of mass in the world, m/s."""
        return fixed_order.apply(self.centre_of_mass_jacobian(), self._data.qvel)

    def link_frames(self, links: IntArray) -> tuple[FloatArray, FloatArray]:
        """Origins (k, 3) in m and axes (k, 3, 3), as columns, of some link frames in the world.

        `links` (k,) are indices of `Character.links`.
        """
        bodies = links + 1
        return self._data.xpos[bodies], self._data.xmat[bodies].reshape(-1, 3, 3)

    def point_jacobian(self, link: int, point: FloatArray) -> FloatArray:
        """The Jacobian J (6, n) of a point (3,) that moves with a link; point in the world, m.

        `(velocity, angular velocity) = J v`, world axes. A force (N) at the point and a moment
        (N m) about it are the generalised force `J^T w` of the wrench (6,).
        """
        jacobian = np.empty((6, self._layout.size))
        mujoco.mj_jac(self._model, self._data, jacobian[:3], jacobian[3:], point, link + 1)
        return jacobian


def _doubles(*numbers: FloatArray | float) -> Any:
    return [np.asarray(each, dtype=np.float64)[()] for each in numbers]


def still_model(character: Character, position: FloatArray) -> DynamicsModel:
    """The model of a character that is at rest in a position (n,), message form."""
    model = DynamicsModel(character)
    model.update(position, np.zeros(character.layout.size))
    return model


def _compile(character: Character, gravity: float) -> mujoco.MjModel:
    """MuJoCo's model of a character, its bodies in the order of the character's links."""
    spec = mujoco.MjSpec()
    spec.option.gravity = (0.0, 0.0, -gravity)
    add_links(spec, character.links)
    return compile_exactly(spec, character.links)
