"""How fast control must be, and how late it may come: the walk by rate and delay of commands."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from actuated_characters.studies.framework.plots import label
from actuated_characters.studies.framework.result import StudyResult
from actuated_characters.studies.framework.study import WALK, RunSpec, Study, StudyRunner
from actuated_characters.studies.framework.tracking import (
    delayed_spectral_radius,
    fall_time,
    joint_errors,
)
from controller_node import parameters as controller_parameters
from controller_node.control_laws import GainArrays
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character
from msgs_config.parameters import resolve

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
    def text(self) -> str:
        """What became of it, in a few words."""
        if self.diverged:
            return f"diverges\n{self.end:.2f} s"
        if self.fall is not None:
            return f"falls\n{self.fall:.2f} s"
        return f"{self.error:.3f}"


def _fill(runner: StudyRunner, result: StudyResult) -> None:
    """Walk with root assistance at each rate, the commands late by each number of ticks."""
    character = load_character(_CHARACTER)
    cells = [_measure(runner, character, rate, delay) for rate in _RATES for delay in _DELAYS]
    result.rows += [
        {
            "rate (Hz)": cell.rate,
            "delay (ticks)": cell.delay,
            "delay (ms)": cell.delay_ms,
            "mean joint error (rad)": cell.error,
            "ends at (s)": cell.end,
            "diverged": cell.diverged,
            "falls at (s)": cell.fall,
            "growth a tick by theory": cell.growth,
        }
        for cell in cells
    ]
    lines, grid = result.add_panels(result.name, 1, 2, (13.0, 5.5))
    _draw_lines(lines, cells)
    _draw_map(grid, cells)
    result.notes += [
        "stable PD foresees its own period, not a late command: one tick of delay is "
        "harmless from 480 Hz on, two ticks shake the character at any rate",
        "the error of a run that diverged is that until then",
    ]


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
    simulator = {"rate": rate, "substeps": substeps, "command_delay_ticks": delay}
    case = RunSpec(f"{rate}Hz_{delay}ticks", _CHARACTER, _DURATION, WALK, simulator)
    outcome = runner.run(case)
    run = outcome.recording
    return _Cell(
        rate,
        delay,
        float(joint_errors(run)[:-1].mean()),
        float(run.times[-1]),
        bool(outcome.diverged),
        fall_time(run),
        small_deviations(character, rate, delay, substeps, {"character": _CHARACTER}),
    )


def _draw_lines(axes: Axes, cells: Sequence[_Cell]) -> None:
    """The error over the delay, a line a rate; a cross where the walk fails."""
    for rate in _RATES:
        of_rate = [cell for cell in cells if cell.rate == rate]
        walked = [(cell.delay_ms, cell.error) for cell in of_rate if not cell.fails]
        failed = [(cell.delay_ms, _WORST) for cell in of_rate if cell.fails]
        (line,) = axes.plot(*np.reshape(walked, (-1, 2)).T, "o-", label=f"{rate} Hz")
        (crosses,) = axes.plot(*np.reshape(failed, (-1, 2)).T, "x", color=line.get_color())
        crosses.set(markersize=9, markeredgewidth=2)
    axes.plot([], [], "kx", label="diverges or falls")
    axes.set_yscale("log")
    axes.set_yticks([0.05, 0.1, 0.2, 0.4], ["0.05", "0.1", "0.2", "0.4"])
    axes.set_yticks([], minor=True)
    label(axes, "delay of commands (ms)", "mean joint error (rad)", "walk, 3 s, root assistance")


def _draw_map(axes: Axes, cells: Sequence[_Cell]) -> None:
    errors: FloatArray = np.array([_WORST if cell.fails else cell.error for cell in cells])
    table = errors.reshape(len(_RATES), len(_DELAYS))
    axes.imshow(np.log(table), cmap="viridis_r", vmin=np.log(_BEST), vmax=np.log(_WORST))
    for number, cell in enumerate(cells):
        row, column = divmod(number, len(_DELAYS))
        dark = table[row, column] > (_WORST * _BEST) ** 0.5
        text = f"{cell.text}\n(x {cell.growth:.3f})"
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


STUDY = Study(
    "delay",
    "tracking of the walk by control rate and delay, with root assistance",
    runs=len(_RATES) * len(_DELAYS),
    fill=_fill,
)
