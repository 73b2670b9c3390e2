"""What is to be known of a network beside its weights: terms, orders, scales, gains, period."""

from collections.abc import Mapping
from dataclasses import dataclass

from controller_node.behaviours.onnx_policy.terms import Term, TermOptions
from msgs_config.arrays import FloatArray

ORDERS = ("oldest_first", "newest_first")
GROUPINGS = ("term", "frame")
STARTS = ("repeat", "zeros")


@dataclass(frozen=True, eq=False)
class UsedTerm:
    """A term as a policy's observation has it: clipped, then scaled, then with its history."""

    name: str  # that its file has for it
    term: Term
    options: TermOptions
    labels: tuple[str, ...]  # what each entry is of
    scale: FloatArray  # (s,)
    clip: tuple[float, float] | None  # before the scale
    history: int  # frames, the present one among them

    @property
    def size(self) -> int:
        """Entries of the observation, history and all."""
        return len(self.labels) * self.history


@dataclass(frozen=True)
class History:
    """How the frames of terms with a history lie in an observation."""

    order: str = ORDERS[0]
    by: str = GROUPINGS[0]  # all frames of a term together, or all terms of a frame
    start: str = STARTS[0]  # what is before the first frame: that one again, or zeros


@dataclass(frozen=True, eq=False)
class Description:
    """A policy for m joints; all lists are in its own order of them.

    The targets are `offset + scale * action`, rad or m, and hold for `step_s`.
    """

    joints: tuple[str, ...]  # (m,)
    held_joints: tuple[str, ...]  # that follow the reference instead
    default: FloatArray  # (m,) rad or m
    stiffness: FloatArray  # (m,) N m/rad or N/m
    damping: FloatArray  # (m,) N m s/rad or N s/m
    action_scale: FloatArray  # (m,) rad or m
    action_offset: FloatArray  # (m,) rad or m
    action_clip: tuple[float, float] | None  # of the network's answer
    target_clip: FloatArray | None  # (m, 2) of the targets, rad or m
    step_s: float  # of a decision
    terms: tuple[UsedTerm, ...]
    history: History
    anchor: str  # a link; empty: no term needs one
    motion_bodies: tuple[str, ...]  # those of the motion in a network, in its order
    recurrent: Mapping[str, str]  # an input of the network: the output that it is next time

    @property
    def size(self) -> int:
        """Entries of the observation."""
        return sum(int(term.size) for term in self.terms)

    @property
    def motion_body(self) -> int:
        """The row of the anchor among the bodies of a motion in a network; 0 without one."""
        return self.motion_bodies.index(self.anchor) if self.anchor else 0

    @property
    def needs_command(self) -> bool:
        """Whether a term is a commanded velocity."""
        return any(used.term.needs_command for used in self.terms)

    @property
    def needs_motion(self) -> bool:
        """Whether a term is of a motion."""
        return any(used.term.needs_motion for used in self.terms)

    @property
    def follows_motion(self) -> bool:
        """Whether what joints do depends on the reference's poses."""
        return bool(self.held_joints) or self.needs_motion
