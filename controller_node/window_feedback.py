"""Linear feedback that acts window by window: as sampling-based motion control does, from a state.

At the first state of each window of about 0.1 s it looks at how the character deviates from its
motion, and adds to the tracking errors what that calls for, constant until the window ends. Each
window of a cycle has gains of its own. Held so, it does not answer to the jolts within a window.

Sources: Liu, van de Panne and Yin 2016, "Guided Learning of Control Graphs" (a linear feedback for
each fragment of about 0.1 s, added to its tracking targets).
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from controller_node.references.base import Reference
from controller_node.window_gains import BALANCE_FEATURES, WindowGains
from msgs_config import rotations
from msgs_config.arrays import FloatArray
from msgs_config.character import Character
from msgs_config.dynamics import DynamicsModel
from msgs_config.errors import CharacterError, LayoutError
from msgs_config.joint_layout import ROOT, Configuration

# configuration, velocity (n,), centre of mass (3,) in m, its velocity (3,) in m/s, heading in rad
_Wanted = tuple[Configuration, FloatArray, FloatArray, FloatArray, float]


class Deviations:
    """How a character deviates from a motion, as numbers (12 + 2 m).

    The centre of mass and its velocity (m, m/s; x ahead and y to the left of the motion's root),
    the root's tilt and spin (rad, rad/s, base frame), and how far m degrees of freedom are from
    the motion, and how much faster (rad, rad/s; rotation vectors in the motion's child frames): the
    state less the motion, each. Zero on the motion.
    """

    def __init__(self, character: Character, motion: Reference, dofs: Sequence[str]) -> None:
        """Of a motion, at the degrees of freedom named.

        Raises:
            CharacterError: the base is fixed.
            LayoutError: there is no such degree of freedom, a part of a ball joint is missing, or
                it is one of the base, which has no motor.
        """
        if not character.layout.has_floating_base:
            raise CharacterError(f"{character.file}: window feedback needs a floating base")
        self.layout = character.layout
        self.entries = character.layout.indices(tuple(dofs))
        if self.layout.mask((ROOT,))[self.entries].any():
            raise LayoutError(
                f"window feedback: '{ROOT}' is moved; only joints with a motor can be"
            )
        self._model = DynamicsModel(character)
        self._motion = motion
        self._wanted_at = lru_cache(maxsize=1024)(self._wanted)

    @property
    def width(self) -> int:
        """How many numbers."""
        return BALANCE_FEATURES + 2 * len(self.entries)

    def of(self, time: float, position: FloatArray, velocity: FloatArray) -> FloatArray:
        """The features (12 + 2 m) of a state (n,), (n,) at a time in s."""
        wanted, moving, centre, centre_velocity, heading = self._wanted_at(time)
        model, layout = self._model, self.layout
        model.update(position, velocity)
        error = layout.difference(wanted, layout.configuration(position))
        rate = velocity - moving
        return np.concatenate(
            (
                _seen(heading, model.centre_of_mass() - centre),
                _seen(heading, model.centre_of_mass_velocity() - centre_velocity),
                error[3:6],
                rate[3:6],
                error[self.entries],
                rate[self.entries],
            )
        )

    def _wanted(self, time: float) -> _Wanted:
        state = self._motion.sample(time)
        model, wanted = self._model, state.configuration
        model.update(wanted.position, state.velocity)
        centre, moving = model.centre_of_mass().copy(), model.centre_of_mass_velocity().copy()
        heading = float(rotations.yaw(rotations.exp(wanted.position[3:6])))
        return wanted, state.velocity, centre, moving, heading


class WindowFeedback:
    """The window feedback of a character about a motion.

    It remembers what it answered to the first state of the present window, and no more: whoever
    begins with a window gets the same answers as who was there before.
    """

    def __init__(self, deviations: Deviations, gains: WindowGains, ends: Sequence[float]) -> None:
        """With gains that fit the deviations; windows end at times in s, after the last is none."""
        self._deviations, self._gains = deviations, gains
        self._starts = [0.0, *ends]
        self._held: tuple[int, FloatArray] | None = None  # of a window

    def begin_episode(self) -> None:
        """Forget the present window."""
        self._held = None

    def response(self, time: float, position: FloatArray, velocity: FloatArray) -> FloatArray:
        """What is added to the tracking errors (n,) of a state at a time in s, rad.

        If the first state of a window was not seen, the first one that is seen counts.
        """
        window = bisect_right(self._starts, time) - 1
        begins = time == self._starts[window]
        if self._held is None or self._held[0] != window or begins:
            self._held = window, self._answer(window, time, position, velocity)
        return self._held[1]

    def _answer(
        self, window: int, time: float, position: FloatArray, velocity: FloatArray
    ) -> FloatArray:
        response = np.zeros(self._deviations.layout.size)
        if window < len(self._starts) - 1:
            features = self._deviations.of(time, position, velocity)
            response[self._deviations.entries] = self._gains.offset(window, features)
        return response


def _seen(heading: float, vector: FloatArray) -> FloatArray:
    """A vector (3,) of the world, as who looks into a heading in rad sees it."""
    cosine, sine = math.cos(heading), math.sin(heading)
    x, y, z = vector.tolist()
    return np.array((cosine * x + sine * y, cosine * y - sine * x, z))
