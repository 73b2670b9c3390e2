"""What a character must do in a trial, judged by its recorded states and nothing else."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from actuated_characters.metrics.error_measures import joint_errors
from actuated_characters.metrics.falls import (
    PostureReader,
    fall_row,
    is_down,
    reader_for,
)
from controller_node.references.base import Reference
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointLayout
from msgs_config.character.model import Character, UrdfOptions
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.mappings import MappingReader

POSTURES = ["upright", "reference", "any"]
_KEYS = ("posture", "joint_error", "travels", "at_end")


@dataclass(frozen=True)
class Goal:
    """What is asked of a character; whether it was reached follows from its states alone."""

    posture: str = POSTURES[0]  # it must not fall from this one, where its base floats
    joint_error: float | None = None  # rad, the largest mean distance from the run's reference
    travels: tuple[float, float] | None = None  # m along the ground, from start to end
    at_end: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Least and largest position in the last state, rad or m, by the degree of freedom."""

    def check(self, layout: JointLayout) -> None:
        """Raise ConfigurationError if a degree of freedom is none of a character's."""
        for name in self.at_end:
            if name not in layout.dof_names:
                raise ConfigurationError(one_of("degree of freedom", name, list(layout.dof_names)))
        if self.travels is not None and not layout.has_floating_base:
            raise ConfigurationError("goal.travels: the character's base is fixed")


@dataclass(frozen=True)
class Judgement:
    """What became of a goal."""

    why: str  # a sentence
    failed_at: float | None = None  # s since the first state; None: it did what it should
    travelled: float | None = None  # m
    joint_error: float | None = None  # rad

    @property
    def has_survived(self) -> bool:
        """Whether it did all that was asked."""
        return self.failed_at is None


def read_goal(reader: MappingReader) -> Goal:
    """The goal in a mapping.

    Raises:
        ConfigurationError: it says something else, or a bound is above another.
    """
    reader.check_keys(_KEYS)
    at_end = reader.part("at_end")
    bounds = {name: _bounds(at_end, name) for name in at_end.content}
    travels = _bounds(reader, "travels") if "travels" in reader.content else None
    error = reader.number("joint_error", minimum=0.0) if "joint_error" in reader.content else None
    return Goal(reader.choice("posture", POSTURES), error, travels, bounds)


def _bounds(reader: MappingReader, key: str) -> tuple[float, float]:
    least, largest = reader.numbers(key, 2)
    if least > largest:
        raise reader.wrong(key, reader.content[key], "[LEAST, LARGEST]")
    return least, largest


def judge(
    goal: Goal,
    character: Character,
    position: FloatArray,
    rate_hz: float,
    reference: Reference,
    terrain: UrdfOptions | None = None,
) -> Judgement:
    """Judge states (t + 1, n), one a tick from the first one on.

    Args:
        goal: What was asked.
        character: Whose states they are.
        position: The states, message form.
        rate_hz: Ticks a second.
        reference: Where the trial, not the controller, wanted the character to be.
        terrain: What there is beside the plane.

    Raises:
        CharacterError: the terrain cannot be loaded.
    """
    layout, last = character.layout, (len(position) - 1) / rate_hz
    needs_reference = goal.joint_error is not None or goal.posture == "reference"
    desired = np.full_like(position, np.nan)
    if needs_reference:
        times = (np.arange(len(position)) / rate_hz).tolist()
        desired = np.array([reference.sample(time).configuration.position for time in times])
    error = travelled = None
    if goal.joint_error is not None:
        error = float(np.mean(joint_errors(layout, position, desired)))
    if layout.has_floating_base:
        travelled = float(np.hypot(*(position[-1, :2] - position[0, :2])))
    fell = None
    if layout.has_floating_base and goal.posture != "any":
        of_posture = desired if goal.posture == "reference" else np.full_like(position, np.nan)
        fell = _fall_time(reader_for(character, terrain), position, of_posture, rate_hz)
    if fell is not None:
        return Judgement(f"It fell at {fell:.3g} s of {last:.4g} s.", fell, travelled, error)
    complaint = _complaint(goal, layout, position[-1], travelled, error)
    if complaint:
        return Judgement(f"{complaint}.", last, travelled, error)
    return Judgement(f"It did what it should for {last:.4g} s.", None, travelled, error)


def _fall_time(
    reader: PostureReader | None, position: FloatArray, desired: FloatArray, rate_hz: float
) -> float | None:
    """When a body fell, s; None if it did not."""
    assert reader is not None
    down = is_down(reader.read(position), reader.read(desired), reader.standing_height)
    row = fall_row(down, np.arange(len(position), dtype=float), rate_hz)
    return None if row is None else row / rate_hz


def _complaint(
    goal: Goal,
    layout: JointLayout,
    end: FloatArray,
    travelled: float | None,
    error: float | None,
) -> str:
    """What a character did not do that did not fall; empty if it did all."""
    for name, (least, largest) in goal.at_end.items():
        value = float(end[layout.dof_names.index(name)])
        if not least <= value <= largest:
            return f"'{name}' ended at {value:.4g}, which should be {least:g} to {largest:g}"
    if goal.travels is not None and travelled is not None:
        least, largest = goal.travels
        if not least <= travelled <= largest:
            return f"It went {travelled:.3g} m, which should be {least:g} to {largest:g} m"
    if goal.joint_error is not None and error is not None and not error <= goal.joint_error:
        return f"Its mean joint error was {error:.3g} rad, above {goal.joint_error:g} rad"
    return ""
