"""Responses of the mass of `lift` to control laws, their theory, and bounds of stability."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from lecture.theory import second_order
from msgs_config.arrays import FloatArray

MASS, GRAVITY, TARGET, RATE = 1.0, 9.81, 1.0, 240  # kg, m/s^2, m, Hz
PERIOD, WEIGHT = 1.0 / RATE, MASS * GRAVITY  # s, N
STIFFNESS, CRITICAL = 100.0, 20.0  # N/m, N s/m: the character's own

_RESOLUTION = 1.05  # ratio of two stiffnesses between which a bound is found well enough
_BRACKET = (0.7, 1.4)  # shares of the bound by theory, between which the search begins
_TAIL = RATE // 2  # states that a steady state is the mean of, where nothing swings


@dataclass(frozen=True)
class LiftLaw:
    """A law and its gains, and the theory of both."""

    law: str
    stiffness: float  # N/m
    damping: float  # N s/m
    integral: float = 0.0  # N/(m s)

    @classmethod
    def critical(cls, law: str, stiffness: float) -> "LiftLaw":
        """Critically damped, in continuous time."""
        return cls(law, stiffness, second_order.critical_damping(stiffness, MASS))

    @property
    def error_by_theory(self) -> float:
        """The steady-state error, m: `m g / kp`, unless the law removes it."""
        return 0.0 if self.law in ("pd_gravity", "pid") else WEIGHT / self.stiffness

    @property
    def ratio_by_theory(self) -> float | None:
        """The damping ratio: of stable PD in its own closed form, else of continuous time."""
        if self.law == "pid":
            return None
        if self.law == "stable_pd":
            return second_order.stable_pd_damping_ratio(self.stiffness, self.damping, MASS, PERIOD)
        return second_order.damping_ratio(self.stiffness, self.damping, MASS)

    @property
    def stable_by_theory(self) -> bool:
        """True if the law with these gains is stable; PID by its bound in continuous time."""
        gains = self.stiffness, self.damping, MASS
        if self.law == "pid":
            return self.integral < second_order.largest_integral_gain(*gains)
        if self.law == "stable_pd":
            return second_order.stable_pd_is_stable(*gains, PERIOD)
        return second_order.explicit_is_stable(*gains, PERIOD)


@dataclass(frozen=True)
class Response:
    """A motion of the mass, from rest at 0 m towards the target, and its measures."""

    gains: LiftLaw
    times: FloatArray  # (t,) s
    height: FloatArray  # (t,) m
    diverged: bool

    @property
    def stable(self) -> bool:
        """True if the motion decays towards its rest instead of growing."""
        wider = second_order.swings_wider(self.height, TARGET - self.gains.error_by_theory)
        return not (self.diverged or wider)

    @property
    def rest(self) -> float:
        """The height (m) at which the mass comes to rest, or about which it swings."""
        if self.gains.law == "pid":
            return float(self.height[-_TAIL:].mean())
        return second_order.identify(self.height, PERIOD).rest

    @property
    def ratio(self) -> float | None:
        """The damping ratio; None for PID, which is not of second order."""
        if self.gains.law == "pid":
            return None
        return second_order.identify(self.height, PERIOD).damping_ratio


@dataclass(frozen=True)
class Bound:
    """The stiffness at which critically damped PD ceases to be stable."""

    law: str
    theory: float  # N/m
    evaluated: tuple[Response, ...]  # responses in rising order of stiffness

    @property
    def below(self) -> Response:
        """The stiffest that was stable."""
        return [response for response in self.evaluated if response.stable][-1]

    @property
    def above(self) -> Response:
        """The softest that was not."""
        return next(response for response in self.evaluated if not response.stable)

    @property
    def found(self) -> float:
        """Between the two, N/m."""
        return math.sqrt(self.below.gains.stiffness * self.above.gains.stiffness)


def find_bound(respond: Callable[[LiftLaw], Response], law: str, theory: float) -> Bound:
    """Bisect for the bound of a law between stiffnesses (N/m) around that of theory."""
    low, high = (share * theory for share in _BRACKET)
    evaluated = [respond(LiftLaw.critical(law, stiffness)) for stiffness in (low, high)]
    while high / low > _RESOLUTION:
        middle = math.sqrt(low * high)
        evaluated.append(respond(LiftLaw.critical(law, middle)))
        low, high = (middle, high) if evaluated[-1].stable else (low, middle)
    evaluated.sort(key=lambda response: response.gains.stiffness)
    return Bound(law, theory, tuple(evaluated))
