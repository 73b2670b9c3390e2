"""The figures of the study `athletics`."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.render.plots import label
from actuated_characters.render.stills import strip
from actuated_characters.report.events import mode_events
from lecture.athletics.measures import (
    FEET,
    CourseSeries,
    loaded,
    longest_flight,
    taken,
)
from lecture.athletics.pushes import LARGEST, PushMap
from lecture.framework.result import StudyResult

if TYPE_CHECKING:  # it takes a second to import
    from matplotlib.axes import Axes

_JUMP_POSES = (0.9, 1.55, 1.7, 1.85, 2.0, 2.1, 2.5, 3.5)  # s


def draw_courses(
    result: StudyResult, name: str, title: str, runs: Mapping[str, Recording], wanted: CourseSeries
) -> None:
    """A column a run of the same commands: which foot stands, speed, heading."""
    panels = result.add_panels(name, 3, len(runs), (12.0, 7.0), title=title, same_x=True)
    for column, (athlete, recording) in enumerate(runs.items()):
        feet, speed, heading = panels[column :: len(runs)]
        _draw_feet(feet, recording)
        feet.set_title(athlete, fontsize="medium")
        course, times = taken(recording), recording.times
        for panel, got, told, unit in (
            (speed, course.speed, wanted.speed, "speed ahead (m/s)"),
            (heading, course.heading, wanted.heading, "heading (rad)"),
        ):
            panel.plot(times, got, label="mean of 0.5 s")
            panel.plot(times, told[: len(times)], "k--", linewidth=1.0, label="commanded")
            label(panel, "time (s)", unit)
        result.add_curves(
            f"{result.name}_{athlete}",
            {"time_s": times, "speed_m_s": course.speed, "heading_rad": course.heading},
        )


def _draw_feet(panel: "Axes", recording: Recording) -> None:
    """The feet that touch the ground, and below them the states."""
    times, rows, sides = recording.times, loaded(recording), ["right foot", "left foot"]
    for column in range(len(FEET)):
        edges = np.flatnonzero(np.diff(np.r_[0, rows[:, column], 0])).reshape(-1, 2)
        bars = [(float(times[a]), float(times[b] - times[a])) for a, b in edges]
        panel.broken_barh(bars, (column + 0.6, 0.8), color=f"C{column}")
    spans = [span for span in mode_events(recording) if "state" in span.facts]
    names = sorted({str(span.facts["state"]) for span in spans})
    for span in spans:
        color = f"C{2 + names.index(str(span.facts['state'])) % 8}"
        panel.broken_barh([(span.start, span.duration)], (-0.4, 0.8), color=color)
    for place, name in enumerate(names):
        panel.plot([], [], color=f"C{2 + place % 8}", linewidth=5, label=name)
    if names:
        panel.legend(ncols=3, fontsize="x-small", loc="upper right", title="state")
    panel.set_yticks(*(([0, 1, 2], ["state", *sides]) if names else ([1, 2], sides)))
    panel.set_ylim(-0.5 if names else 0.5, 4.2 if names else 2.6)


def draw_jump(result: StudyResult, recording: Recording) -> None:
    """The feet, the height of the root, and poses."""
    start, flight = longest_flight(recording)
    title = f"the machine `jump`: {flight:.2f} s without contact"
    feet, height = result.add_panels(f"{result.name}_jump", 2, 1, (10.0, 5.0), title=title)
    _draw_feet(feet, recording)
    height.plot(recording.times, recording.position[:, 2], label="root")
    height.axvspan(start, start + flight, color="0.85", label="flight")
    label(height, "time (s)", "height (m)")
    for panel in (feet, height):
        panel.set_xlim(0.5, float(recording.times[-1]))
    draw_poses(result, "jump", recording, _JUMP_POSES)


def draw_poses(
    result: StudyResult, name: str, recording: Recording, times: Sequence[float]
) -> None:
    """A strip of poses at some times, s."""
    poses = {name: strip(recording, times)}
    result.add_pictures(f"{result.name}_{name}_poses", poses, title_height=0.4)


def draw_pushes(result: StudyResult, maps: Mapping[str, PushMap]) -> None:
    """By direction: the largest impulse that was survived, and the least that threw it down."""
    (panel,) = result.add_panels(f"{result.name}_pushes", 1, 1, (6.0, 6.0))
    for number, (name, pushes) in enumerate(maps.items()):
        fell = np.array(pushes.fell)
        fell[fell >= LARGEST] = np.nan  # nothing that was tried threw it down
        for values, style, what in (
            (np.array(pushes.survived), "-", "survives"),
            (fell, ":", "falls"),
        ):
            x, y = (pushes.along(values.tolist(), axis) for axis in (0, 1))
            panel.plot(x, y, f"C{number}{style}o", markersize=4, label=f"{name} {what}")
        result.add_curves(
            f"{result.name}_pushes_{name}",
            {
                "direction_rad": np.array(pushes.directions),
                "survives_N_s": np.array(pushes.survived),
                "falls_N_s": fell,
            },
        )
    panel.set_aspect("equal")
    label(panel, "to the right (N s)", "ahead (N s)", "impulse by direction, at 0.6 m/s")
