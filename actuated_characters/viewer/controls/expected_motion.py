"""What theory expects of one mass on a vertical slider: the lecture's lift, in continuous time."""

from collections.abc import Mapping

import numpy as np

from actuated_characters.viewer.drawing.sample import CharacterSample
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import still_model
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character
from msgs_config.geometry import rotations
from msgs_config.messages.state import StampedState

_DAMPED, _INTEGRATED, _UNLOADED = (
    ("pd", "stable_pd", "pd_gravity", "pid"),
    ("pid",),
    ("pd_gravity",),
)
_KNOWN_LAWS = ("p", *_DAMPED)
_JUMP, _FASTER = 0.05, 3.0  # m, and times the speed: farther is no motion but a reset
_TERMS = 14  # of the exponential's series: exact to rounding for arguments below one half


def exponential(matrix: FloatArray) -> FloatArray:
    """The exponential of a matrix (n, n), by its series, scaled and squared."""
    halvings = max(0, int(np.ceil(np.log2(max(np.abs(matrix).sum(axis=1).max(), 1e-12)))) + 1)
    scaled, term = matrix / 2.0**halvings, np.eye(len(matrix))
    total: FloatArray = term
    for power in range(1, _TERMS + 1):
        term = term @ scaled / power
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return total


class ExpectedMotion:
    """The height of a mass under P, PD or PID, from its state at the last change on.

    `m x'' = kp e + kd e' + ki (integral of e) - m g` with the error `e` to a target that rests,
    solved by the exponential of its matrix. A change is one of gains, strength, law, gravity or
    target, or that something pushes or touches the mass. Limits of the force are not in it.
    """

    def __init__(self, character: Character) -> None:
        """For a character that is one mass on a slider, see `fits`."""
        name = character.layout.joints[0].name
        self.parameters = (
            "law", "gravity", "gain_scale.p", "gain_scale.d", f"strength.{name}",
            *(f"gains.{name}.{kind}" for kind in "pdi"),
        )  # fmt: skip
        """Those of the controller that the motion depends on."""
        self._mass = _moving_mass(character)  # kg
        self._values: tuple[object, ...] = ()
        self._upcoming: FloatArray | None = None  # the matrix from the next state on
        self._matrix: FloatArray | None = None
        self._law = self._upcoming_law = ""
        self._start: FloatArray = np.zeros(4)  # x - target, v, the error's integral, 1
        self._since = self._last = self._target = 0.0  # s, s, m
        self._begins = True
        self._before: StampedState | None = None  # the last state

    @staticmethod
    def fits(character: Character) -> bool:
        """Whether a character is one mass on a slider that leads upwards."""
        joints = character.layout.joints
        if len(joints) != 1 or joints[0].type is not JointType.PRISMATIC:
            return False
        model = still_model(character, np.array(character.rest_position))
        row = _moving_row(character)
        axis = np.array(character.links[row].joint.axis_in_child)
        upwards: float = rotations.rotate(model.link_poses()[1][row], axis)[2]
        return upwards > 1.0 - 1e-9

    def set(self, values: Mapping[str, object]) -> None:
        """Take the values of `parameters` that the controller has; none: it has not answered."""
        found = tuple(values.get(name) for name in self.parameters)
        if found == self._values or not values:
            return
        self._values, self._begins, self._upcoming = found, True, None
        law = self._upcoming_law = str(found[0])
        if law in _KNOWN_LAWS:
            gravity, scale_p, scale_d, strength, p, d, i = map(_number, found[1:])
            kp, ki = (strength * each / self._mass for each in (p * scale_p, i))
            kd = strength * d * scale_d / self._mass
            self._upcoming = np.array(
                (
                    (0.0, 1.0, 0.0, 0.0),
                    (-kp, -kd * (law in _DAMPED), ki * (law in _INTEGRATED), -gravity),
                    (-1.0, 0.0, 0.0, 0.0),
                    (0.0, 0.0, 0.0, 0.0),
                )
            )
            if law in _UNLOADED:
                self._upcoming[1, 3] = 0.0

    def take(self, sample: CharacterSample) -> None:
        """Begin anew in this state if something has changed."""
        state = sample.state
        if state is None or sample.reference is None:
            return
        time, target = 1e-9 * state.stamp_ns, float(sample.reference[0])
        is_touched = any(
            each is not None and each.links for each in (sample.pushes, sample.contacts)
        )
        restarts = time < self._last or self._jumps(state)
        if self._begins or is_touched or restarts or target != self._target:
            # a law begins without an integral, and keeps it where its gains change
            keeps = not restarts and self._law == self._upcoming_law
            integral = float(self._state_at(time)[2]) if keeps else 0.0
            place, speed = float(state.position[0]), float(state.velocity[0])
            self._start = np.array((place - target, speed, integral, 1.0))
            self._since, self._target, self._begins = time, target, False
            self._matrix, self._law = self._upcoming, self._upcoming_law
        self._last, self._before = time, state

    def _jumps(self, state: StampedState) -> bool:
        """Whether the mass has moved as none moves by itself: it was put back to its start."""
        if (before := self._before) is None:
            return False
        seconds = 1e-9 * (state.stamp_ns - before.stamp_ns)
        fastest = max(abs(float(each.velocity[0])) for each in (before, state))
        moved = abs(float(state.position[0] - before.position[0]))
        return moved > _JUMP + _FASTER * fastest * seconds

    def at(self, time: float) -> float:
        """The expected height at a time, s, in m; NaN where theory says nothing."""
        if self._matrix is None:
            return float("nan")
        return float(self._state_at(time)[0]) + self._target

    def _state_at(self, time: float) -> FloatArray:
        if self._matrix is None:
            return self._start
        state: FloatArray = exponential(self._matrix * (time - self._since)) @ self._start
        return state


def _number(value: object) -> float:
    """A parameter's number; 0 for one that the controller does not have."""
    return float(value) if isinstance(value, int | float) else 0.0


def _moving_row(character: Character) -> int:
    """The number of the first link that the one joint moves."""
    kinds = [link.joint.type for link in character.links]
    return next(row for row, kind in enumerate(kinds) if kind is JointType.PRISMATIC)


def _moving_mass(character: Character) -> float:
    """The mass of that link and of all that hang on it, kg."""
    first = _moving_row(character)
    moving = {first}
    for row, link in enumerate(character.links):
        if link.parent in moving:
            moving.add(row)
    return sum(character.links[row].mass for row in moving)
