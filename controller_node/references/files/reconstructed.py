"""The project's own format for a reconstructed motion: a clip with the plan that keeps it, as JSON.

`Loop` and `Frames` are those of the clip (`clip.py`), so that whatever reads clips reads the
motion. `Plan` has the control rate in Hz (`rate`), the ticks that it lasts (`ticks`) and from one
knot to the next (`knot_ticks`), the degrees of freedom (`dofs`), and `parts`: from a tick on
(`tick`), offsets at knots, the first of a number (`knot`), rad or m (`offsets`). What made the file
stands in `Reconstruction`; a run takes its length, its parameters and its pushes from there.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from controller_node.references.offsets import Offsets, RecordedPlan, knot_before
from msgs_config.character.layout import JointLayout
from msgs_config.clips.reading import ClipFile
from msgs_config.errors import ClipError

PLAN, RECONSTRUCTION = "Plan", "Reconstruction"
SUFFIX = ".json"

_LARGEST_OFFSET = 1e3  # rad or m; more is a mistake
_ERRORS_OF_MALFORMED = (ValueError, KeyError, TypeError, OverflowError)


@dataclass(frozen=True)
class FoundWith:
    """The run in which a motion was found; in any other one it is another motion."""

    duration: float  # s, as far as it was found
    simulator: Mapping[str, object]  # parameters of `sim_node`, by name
    controller: Mapping[str, object]  # parameters of `controller_node`, by name
    pushes: tuple[str, ...]  # each as LINK:FX,FY,FZ@S; they came in the search, too


class ReconstructedClip(ClipFile):
    """A clip's file with the plan that keeps its motion, and the run that it was found in.

    Each part is checked when it is asked for, and raises ClipError if it is malformed, or does not
    fit the character.
    """

    @cached_property
    def plan(self) -> RecordedPlan | None:
        """The plan that keeps the motion; None if the file has none."""
        if PLAN not in self.content:
            return None
        return _plan(self.path, self.character.layout, self.content[PLAN])

    @cached_property
    def found_with(self) -> FoundWith | None:
        """The run that the motion was found in; None if the file does not say."""
        made = self.content.get(RECONSTRUCTION)
        if made is None:
            return None
        try:
            sides, pushes = made["parameters"], made.get("pushes", [])
            if not isinstance(pushes, list) or not all(isinstance(push, str) for push in pushes):
                raise TypeError
            return FoundWith(
                float(made["duration"]),
                dict(sides["sim_node"]),
                dict(sides["controller_node"]),
                tuple(pushes),
            )
        except _ERRORS_OF_MALFORMED as error:
            raise ClipError(
                f"{self.path}: {RECONSTRUCTION} must have 'duration', 'parameters' of sim_node "
                "and of controller_node, and 'pushes' as texts, if any"
            ) from error


def _plan(path: Path, layout: JointLayout, content: Any) -> RecordedPlan:
    place = f"{path}: {PLAN}"
    try:
        rate, ticks, knot_ticks = (int(content[key]) for key in ("rate", "ticks", "knot_ticks"))
        dofs = [str(name) for name in content["dofs"]]
        starts = [int(part["tick"]) for part in content["parts"]]
        offsets = [
            Offsets(knot_ticks, int(part["knot"]), np.array(part["offsets"], dtype=float))
            for part in content["parts"]
        ]
    except _ERRORS_OF_MALFORMED as error:
        raise ClipError(
            f"{place} must have 'rate', 'ticks' and 'knot_ticks', 'dofs', and 'parts' with 'tick', "
            "'knot' and 'offsets'"
        ) from error
    if not layout.has_floating_base or dofs != list(layout.dof_names[6:]):
        raise ClipError(f"{place}: dofs must be the actuated ones of the character, in its order")
    if min(rate, ticks, knot_ticks) < 1 or not starts:
        raise ClipError(
            f"{place}: rate, ticks, knot_ticks and the number of parts must be 1 or more"
        )
    if starts[0] < 0 or not (np.diff([*starts, ticks]) > 0).all():
        raise ClipError(f"{place}: the parts' ticks must rise, from 0 to below 'ticks'")
    for part, first, then in zip(offsets, starts, [*starts[1:], ticks], strict=True):
        _check_part(f"{place}: from tick {first} on", part, first, then, len(dofs))
    return RecordedPlan(rate, ticks, tuple(zip(starts, offsets, strict=True)))


def _check_part(place: str, part: Offsets, first: int, then: int, width: int) -> None:
    """Raise ClipError if a part lacks knots for the ticks from the first to before the next."""
    begins, ends = (knot_before(tick, part.knot_ticks)[0] for tick in (first, then - 1))
    shape = ends + 2 - begins, width
    if part.first_knot != begins or part.rows.shape != shape:
        raise ClipError(
            f"{place} offsets are {part.rows.shape} from knot {part.first_knot} on; they must be "
            f"{shape} from knot {begins} on"
        )
    if not (np.abs(part.rows) <= _LARGEST_OFFSET).all():  # NaN is not within
        raise ClipError(f"{place} an offset is not finite, or over {_LARGEST_OFFSET:g}")
