"""What is expected of a plan, for `~/plan`, reports and pictures."""

from dataclasses import dataclass

from controller_node.planner.anchor import Anchor
from msgs_config.arrays import FloatArray


@dataclass(frozen=True)
class Outlook:
    """What a plan is expected to lead to at each of its checks."""

    times: FloatArray  # (checks,) s after the first state in which it acts
    centres: FloatArray  # (checks, 3) m, centres of mass in the world
    costs: FloatArray  # (checks,) of the deviations from the reference; the plan's is their sum
    alternatives: FloatArray  # (checks,) costs of the best other plan that was tried
    anchor: Anchor  # puts the reference's world where it gave way to
