"""What other policies would do in their clips, for a policy of many clips to learn from.

Sources: Ross et al. 2011, "A Reduction of Imitation Learning and Structured Prediction to No-Regret
Online Learning": the pupil acts, and teachers say what they would have done in its states; Schmitt
et al. 2018, "Kickstarting Deep Reinforcement Learning": they are heard less and less.
"""

from collections.abc import Sequence

import numpy as np

from actuated_characters.training.episode_types import Taught
from actuated_characters.training.learner import forward
from actuated_characters.training.starts import StartRange
from controller_node.planner.compiled.network import Network
from controller_node.planner.compiled.observation import ObservationScales
from controller_node.planner.policy.file import Policy
from msgs_config.arrays import IntArray, SingleArray

_ALONE_UNTIL, _LEAST = 0.6, 0.2  # share of a training; of what counts, at its end


def heard(course: float) -> float:
    """How much teachers count, by how far a training is: all at first, then less and less.

    Where they no longer counted, falls became more frequent again.
    """
    left = max(1.0 - course, 0.0) / (1.0 - _ALONE_UNTIL)
    return _LEAST + (1.0 - _LEAST) * min(left, 1.0)


class Teachers:
    """Policies that know some references of a table."""

    def __init__(
        self,
        policies: Sequence[Policy | None],
        starts: Sequence[StartRange],
        scales: ObservationScales,
    ) -> None:
        """`policies` are of the first references, `scales` those of the pupil's observations."""
        self._networks = {
            reference: _seen_through(policy, scales)
            for reference, policy in enumerate(policies)
            if policy is not None
        }
        self._size = max((each.weights_3.shape[1] for each in self._networks.values()), default=0)
        self._firsts = np.array([each.first for each in starts])

    def answer(self, observations: SingleArray, rows: IntArray, share: float) -> Taught | None:
        """What they say to observations (m, o) at rows (m,) of the table; None without any."""
        if not self._networks:
            return None
        references = np.searchsorted(self._firsts, rows, side="right") - 1
        actions = np.zeros((len(rows), self._size), np.float32)
        shares = np.zeros(len(rows), np.float32)
        for reference, network in self._networks.items():
            own = references == reference
            actions[own] = forward(network, observations[own])[0]
            shares[own] = share
        return Taught(actions, shares)


def _seen_through(policy: Policy, scales: ObservationScales) -> Network:
    """A policy's network, for observations of other scales.

    Observations are linear but for their bounds, so that the first layer takes the change.
    """
    given, own, network = scales, policy.scales, policy.network
    factors = np.concatenate(
        [given.deviation / own.deviation, (given.frame_scale / own.frame_scale).ravel()]
    )
    off = ((given.frame_mean - own.frame_mean) / own.frame_scale).ravel()
    weights = network.weights_1.astype(float)
    bias = network.bias_1 + off @ weights[len(own.deviation) :]
    return network._replace(
        weights_1=(factors[:, np.newaxis] * weights).astype(np.float32),
        bias_1=bias.astype(np.float32),
    )
