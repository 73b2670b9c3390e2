"""The studies by name, in the lecture's order; each is imported when it is asked for."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # it takes a second to import
    from lecture.framework.study import Study

NAMES = (
    "rigid_body",
    "integrators",
    "constraints",
    "joint_torque",
    "equation",
    "tick",
    "lift",
    "gains",
    "feedforward",
    "delay",
    "assistance",
    "forward_inverse",
    "clips",
    "balance",
    "reactions",
    "athletics",
)


def load_study(name: str) -> "Study":
    """The study of a name: that of the module of that name."""
    from lecture.framework.study import Study

    module = import_module(f"lecture.{name}")
    return Study(name, module.TITLE, module.RUNS, module.run)
