"""What theory expects of one mass on a vertical slider: the lecture's lift, in continuous time."""

from collections.abc import Mapping

import numpy as np

from actuated_characters.viewer.drawing.sample import CharacterSample
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character

_DAMPED, _INTEGRATED, _UNLOADED = (
    ("pd", "stable_pd", "pd_gravity", "pid"),
    ("pid",),
    ("pd_gravity",),
)
_KNOWN_LAWS = ("p", *_DAMPED)
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
    solved by the exponential of its matrix. A change is one of gains, law, gravity or target, or a
    push.
    """

    def __init__(self, character: Character) -> None:
        """For a character that is one mass on a slider, see `fits`."""
        joint = character.layout.joints[0]
        self.parameters = (
            "law", "gain_scale.p", "gain_scale.d", "gravity",
            *(f"gains.{joint.name}.{kind}" for kind in "pdi"),
        )  # fmt: skip
        """Those of the controller that the motion depends on."""
        self._mass = sum(link.mass for link in character.links[1:])  # kg
        self._values: tuple[object, ...] = ()
        self._matrix: FloatArray | None = None
        self._start: FloatArray = np.zeros(4)  # x - target, v, the error's integral, 1
        self._since = self._last = self._target = 0.0  # s, s, m
        self._begins = True

    @staticmethod
    def fits(character: Character) -> bool:
        """Whether a character is one mass on a vertical slider."""
        joints = character.layout.joints
        return (
            len(joints) == 1
            and joints[0].type is JointType.PRISMATIC
            and abs(character.links[-1].joint.axis_in_child[2]) > 1.0 - 1e-9
        )

    def set(self, values: Mapping[str, object]) -> None:
        """Take the values of `parameters` that the controller has."""
        found = tuple(values.get(name) for name in self.parameters)
        if found == self._values:
            return
        self._values, self._begins, self._matrix = found, True, None
        law, scale_p, scale_d, gravity, p, d, i = found
        if str(law) not in _KNOWN_LAWS:
            return
        kp, kd, ki = (float(str(each or 0.0)) / self._mass for each in (p, d, i))
        kp, kd = kp * float(str(scale_p or 0.0)), kd * float(str(scale_d or 0.0)) * (law in _DAMPED)
        load = 0.0 if law in _UNLOADED else float(str(gravity or 0.0))
        self._matrix = np.array(
            (
                (0.0, 1.0, 0.0, 0.0),
                (-kp, -kd, ki * (law in _INTEGRATED), -load),
                (-1.0, 0.0, 0.0, 0.0),
                (0.0, 0.0, 0.0, 0.0),
            )
        )

    def take(self, sample: CharacterSample) -> None:
        """Begin anew in this state if something has changed."""
        state = sample.state
        if state is None or sample.reference is None:
            return
        time, target = 1e-9 * state.stamp_ns, float(sample.reference[0])
        is_pushed = sample.pushes is not None and bool(sample.pushes.links)
        restarts = time < self._last
        if self._begins or is_pushed or restarts or target != self._target:
            integral = 0.0 if restarts else float(self._state_at(time)[2])
            place, speed = float(state.position[0]), float(state.velocity[0])
            self._start = np.array((place - target, speed, integral, 1.0))
            self._since, self._target, self._begins = time, target, False
        self._last = time

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
