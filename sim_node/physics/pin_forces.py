"""The forces of a character's pins: springs and dampers that are stable at any rate and mass.

Of the pins' points, x and v (3m,) are how far they are from their places and their velocities, J
(3m, n) is their Jacobian, and `W = J M^-1 J^T` says how forces there accelerate them. In a tick of
the length h the pins' forces are

    f = -K x - C v,    K = (1/k + h^2 W)^-1,    C = (1/c + h W)^-1,

each then cut to the largest force F of its pin. `k = F / 2 cm`, and `c` is that of critical
damping, `2 sqrt(k m)`, of the mean mass `m = 3 / trace(W_ii)` with which a point resists; but not
less than `h k`.

Where something rests on its pin, the pin gives way by `K^-1 f = f/k + h^2 W f`: `W f` is the
acceleration that the force alone would give the point, so what the rate adds to the spring's way is
0.2 mm at 240 Hz for all that hangs. So the point gives way by 2 cm at the largest force, and beyond
that it slips.

**Stable.** A force that is held over a tick is an explicit one, which a light link with a stiff
spring would not survive. A motion u (n,), of which `u' M u = 1`, grows from tick to tick by the z
of `z^2 - (2 - s a - b) z + 1 - b + (1 - s) a = 0`, with `a = h^2 u' J'KJ u`, `b = h u' J'CJ u`, and
`s = (1 + 1/r) / 2` for r engine steps a tick. Both z are within the unit circle (Jury 1964) if
`b > (1 - s) a` and `2 b + (2 s - 1) a < 4`. The first holds as `c >= h k` makes `b >= a`, and the
second as h^2 W and h W in K and C make a and b less than 1: at any k, c, h and M. It goes on
holding where contacts, joints at their limits and the like make W smaller than it is here.
"""

from collections.abc import Sequence

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character
from msgs_config.geometry import fixed_order
from sim_node.physics.pins import Pin
from sim_node.physics.wrenches import ExternalWrench

YIELD_DISTANCE = 0.02
"""How far a point is from its place when the spring has the pin's largest force, m."""

_LEAST_TRACE = 1e-12  # 1/kg: of what cannot move, such as a base that is fixed
_NOW = (0, 0)  # first tick, and ticks: a force that is found anew in each


class PinForces:
    """The forces of one character's pins, as functions of its state."""

    def __init__(self, character: Character, period: float) -> None:
        """For ticks of a period in s."""
        self._period = period
        self._model = DynamicsModel(character)

    def wrenches(
        self, pins: Sequence[Pin], position: FloatArray, velocity: FloatArray
    ) -> tuple[ExternalWrench, ...]:
        """What pins do during the tick that begins in a state, (n,) each, message form.

        One a pin, in their order; no later tick is named, in which they act still.
        """
        if not pins:
            return ()
        self._model.update(position, velocity)
        links, axes = self._model.link_frames(np.array([pin.link for pin in pins]))
        points = links + fixed_order.apply(axes, np.array([pin.point for pin in pins]))
        jacobian = np.vstack(
            [
                self._model.point_jacobian(pin.link, point)[:3]
                for pin, point in zip(pins, points, strict=True)
            ]
        )
        offsets = (points - np.array([pin.place for pin in pins])).ravel()
        largest = np.array([pin.force for pin in pins])
        forces = self._forces(jacobian, offsets, fixed_order.apply(jacobian, velocity), largest)
        return tuple(
            ExternalWrench(
                pin.link, np.concatenate((force, np.zeros(3))), np.array(pin.point), *_NOW
            )
            for pin, force in zip(pins, forces, strict=True)
        )

    def _forces(
        self, jacobian: FloatArray, offsets: FloatArray, speeds: FloatArray, largest: FloatArray
    ) -> FloatArray:
        """Forces (m, 3) in N, world axes: see above."""
        period, mobility = self._period, self._model.delassus_matrix(jacobian)
        stiffness = largest / YIELD_DISTANCE
        traces = fixed_order.total(mobility.diagonal().reshape(-1, 3))
        masses = 3.0 / np.maximum(traces, _LEAST_TRACE)
        damping = np.maximum(2.0 * np.sqrt(stiffness * masses), period * stiffness)
        forces = np.zeros(len(offsets))
        for gains, share, motion in (
            (stiffness, period * period, offsets),
            (damping, period, speeds),
        ):
            table = share * mobility + np.diag(np.repeat(1.0 / gains, 3))
            forces -= fixed_order.solve(table, motion[:, np.newaxis])[:, 0]
        rows = forces.reshape(-1, 3)
        norms = fixed_order.norm(rows)
        cut: FloatArray = np.minimum(1.0, largest / np.maximum(norms, largest))
        return rows * cut[:, np.newaxis]
