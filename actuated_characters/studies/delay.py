"""How fast control must be, and how late it may come: the walk by rate and delay of commands."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from actuated_characters.metrics.error_measures import fall_time, joint_errors
from actuated_characters.studies.framework.plots import label, make_panels
from actuated_characters.studies.framework.study import RunSpec, StudyResult, StudyRunner
from actuated_characters.studies.framework.tracking import delayed_spectral_radius
from controller_node import parameters as controller_parameters
from controller_node.control_laws import GainArrays
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character
from msgs_config.parameters import resolve

if TYPE_CHECKING:  # it takes a second to import
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_CHARACTER = "humanoid"
_RATES = (120, 240, 480, 960)  # Hz, of control
_DELAYS = (0, 1, 2, 4)  # ticks
_ENGINE_RATE = 960  # Hz; the same for all, so that nothing differs but control
_DURATION = 3.0  # s
_WORST, _BEST = 0.6, 0.05  # rad, the ends of the map's colours


@dataclass(frozen=True)
class _Cell:
    """What became of one rate and delay."""

    rate: int  # Hz
    delay: int  # ticks
    error: float  # rad, mean joint error until the end
    end: float  # s
    diverged: bool
    fall: float | None  # s
    growth: float  # by theory, of a small deviation a tick

    @property
    def delay_ms(self) -> float:
        return 1e3 * self.delay / self.rate

    @property
    def fails(self) -> bool:
        return self.diverged or self.fall is not None

    @property
    def said(self) -> str:
        """What became of it, in a few words."""
        if self.diverged:
            return f"diverges\n{self.end:.2f} s"
        if self.fall is not None:
            return f"falls\n{self.fall:.2f} s"
        return f"{self.error:.3f}"


class DelayStudy:
    """The humanoid walks with root assistance; its commands come late by some ticks."""

    name = "delay"
    title = "tracking of the walk by control rate and delay, with root assistance"
    runs = len(_RATES) * len(_DELAYS)

    def run(self, runner: StudyRunner) -> StudyResult:
        """Walk at each rate with each delay."""
        character = load_character(_CHARACTER)
        cells = [_measure(runner, character, rate, delay) for rate in _RATES for delay in _DELAYS]
        return StudyResult(
            columns=(
                "rate (Hz)",
                "delay (ticks)",
                "delay (ms)",
                "mean joint error (rad)",
                "ends at (s)",
                "diverged",
                "falls at (s)",
                "growth a tick by theory",
            ),
            rows=[
                (
                    cell.rate,
                    cell.delay,
                    cell.delay_ms,
                    cell.error,
                    cell.end,
                    cell.diverged,
                    cell.fall,
                    cell.growth,
                )
                for cell in cells
            ],
            figures={self.name: _draw(cells)},
            notes=(
                "stable PD foresees its own period, not a late command: one tick of delay is "
                "harmless from 480 Hz on, two ticks shake the character at any rate",
                "the error of a run that diverged is that until then",
            ),
        )


def small_deviations(
    character: Character, rate: int, delay: int, substeps: int, given: Mapping[str, object]
) -> float:
    """Growth a tick of small deviations from the rest pose in the air, under the default gains.

    Args:
        character: The character.
        rate: Of control, Hz.
        delay: Ticks by which commands come late.
        substeps: Steps of the engine a tick.
        given: The controller's parameters that are not at their defaults.
    """
    parameters = controller_parameters.PARAMETERS
    own = controller_parameters.character_parameters(character)
    values = resolve(parameters + own, given)
    gains: GainArrays = controller_parameters.make_settings(character, values).gains
    model = DynamicsModel(character)
    model.update(np.array(character.rest_position), np.zeros(character.layout.size))
    return delayed_spectral_radius(
        model.mass_matrix(),
        gains.stiffness,
        gains.damping,
        1.0 / rate,
        delay_ticks=delay,
        substeps=substeps,
    )


def _measure(runner: StudyRunner, character: Character, rate: int, delay: int) -> _Cell:
    substeps = _ENGINE_RATE // rate
    outcome = runner.run(
        RunSpec(
            f"{rate}Hz_{delay}ticks",
            _CHARACTER,
            _DURATION,
            {"reference": "clip", "clip": "walk"},
            {"rate": rate, "substeps": substeps, "command_delay_ticks": delay},
        )
    )
    run = outcome.recording
    times, desired = run.times[:-1], run.reference_position[:-1]
    return _Cell(
        rate,
        delay,
        float(joint_errors(run.layout, run.position[:-1], desired).mean()),
        float(run.times[-1]),
        bool(outcome.diverged),
        fall_time(times, run.position[:-1, 2], desired[:, 2]),
        small_deviations(character, rate, delay, substeps, {"character": _CHARACTER}),
    )


def _draw(cells: Sequence[_Cell]) -> "Figure":
    figure, (lines, grid) = make_panels(1, 2, (13.0, 5.5))
    for rate in _RATES:
        own = [cell for cell in cells if cell.rate == rate]
        held = [cell for cell in own if not cell.fails]
        (line,) = lines.plot(
            [cell.delay_ms for cell in held],
            [cell.error for cell in held],
            "o-",
            label=f"{rate} Hz",
        )
        lost = [cell for cell in own if cell.fails]
        lines.plot(
            [cell.delay_ms for cell in lost],
            [_WORST] * len(lost),
            "x",
            color=line.get_color(),
            markersize=9,
            markeredgewidth=2,
        )
    lines.plot([], [], "kx", label="diverges or falls")
    lines.set_yscale("log")
    lines.set_yticks([0.05, 0.1, 0.2, 0.4], ["0.05", "0.1", "0.2", "0.4"])
    lines.set_yticks([], minor=True)
    label(lines, "delay of commands (ms)", "mean joint error (rad)", "walk, 3 s, root assistance")
    _draw_map(grid, cells)
    return figure


def _draw_map(axes: "Axes", cells: Sequence[_Cell]) -> None:
    errors: FloatArray = np.array([_WORST if cell.fails else cell.error for cell in cells])
    table = errors.reshape(len(_RATES), len(_DELAYS))
    axes.imshow(np.log(table), cmap="viridis_r", vmin=np.log(_BEST), vmax=np.log(_WORST))
    for number, cell in enumerate(cells):
        row, column = divmod(number, len(_DELAYS))
        dark = table[row, column] > (_WORST * _BEST) ** 0.5
        text = f"{cell.said}\n(x {cell.growth:.3f})"
        color = "white" if dark else "black"
        axes.text(column, row, text, ha="center", va="center", fontsize="small", color=color)
    axes.set_xticks(range(len(_DELAYS)), [str(delay) for delay in _DELAYS])
    axes.set_yticks(range(len(_RATES)), [str(rate) for rate in _RATES])
    label(
        axes,
        "delay of commands (ticks)",
        "control rate (Hz)",
        "mean joint error (rad); in brackets theory: growth of\n"
        "small deviations a tick, above 1 unstable",
        legend=None,
    )
    axes.grid(visible=False)


STUDY = DelayStudy()
