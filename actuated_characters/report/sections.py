"""The sections of a report on one character: the result, then charts and tables of each topic."""

import math
from collections.abc import Callable, Iterator, Sequence
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.image import imsave

from actuated_characters.bags.recording import Recording
from actuated_characters.metrics.error_measures import (
    effort_sizes,
    limit_shares,
    vector_kinds,
)
from actuated_characters.metrics.recording_metrics import (
    contact_series,
    gravities,
    measure_recording,
    tracking_errors,
)
from actuated_characters.render.stills import strip
from actuated_characters.report import charts
from actuated_characters.report.facts import late_facts, pace_period, run_facts
from actuated_characters.report.metrics_plot import NOMINAL, describe_metrics
from actuated_characters.report.page import NOT_KNOWN, Illustration, Section, Table
from actuated_characters.report.planning import foresight, plan_chart
from actuated_characters.report.reactions import TRACK, mode_line, thrown_line
from actuated_characters.report.timing import lateness, pauses, wall_steps
from actuated_characters.report.verdict import describe_end, tiles
from msgs_config.arrays import FloatArray
from msgs_config.errors import ActuatedCharactersError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAMES = ("strip", "errors", "root", "efforts", "contacts", "ground", "plans", "histogram", "ticks")
"""Names of the pictures of a run."""

STILLS = 8
"""Default number of poses in the picture of the character."""

_MOST_LISTED = 200
_PERCENTILE = 95
_STATISTICS = ("mean", f"{_PERCENTILE} %", "largest")


class CharacterReport:
    """Makes the sections of one recording."""

    def __init__(self, recording: Recording, prefix: str = "", stills: int = STILLS) -> None:
        """`prefix` comes before the names of the pictures; `stills` is the number of poses."""
        self._recording, self._prefix, self._stills = recording, prefix, stills
        self._facts = facts = run_facts(recording)
        self._kinds = vector_kinds(recording.layout)
        self._names = recording.character.vector_names
        self._limits = recording.character.effort_limits()
        self._errors = tracking_errors(recording)
        self._metrics = self._measured()
        reacts = any(span.mode != TRACK for span in facts.modes)
        self._modes = facts.modes if reacts else []
        times = recording.published_ns if recording.has_wall_times else recording.published_ns[:0]
        self._pauses = pauses(times)
        breaks = recording.episode_rows[1:]
        marks = charts.Marks(
            pushes=[(push.start, push.duration) for push in facts.pushes],
            resets=recording.times[breaks].tolist(),
            changes=sorted({change.time for change in facts.changes}),
            pauses=recording.times[self._pauses].tolist(),
            throws=[throw.start for throw in facts.throws],
            modes=[(span.start, span.duration, span.label) for span in self._modes],
        )
        self._timeline = charts.Timeline(recording.times, breaks, marks)

    def _measured(self) -> dict[str, object]:
        """The figures of the recording, by name."""
        return measure_recording(self._recording)[0]

    @property
    def title(self) -> str:
        """The character, and the motion that was tracked, as far as it was recorded."""
        first = self._recording.controller[0].parameters if self._recording.controller else {}
        kind = first.get("reference")
        motion = first.get(str(kind), kind)
        name = self._recording.character.name
        return f"{name}: {motion}" if isinstance(motion, str) else name

    @property
    def makers(self) -> list[Callable[[], Section]]:
        """Functions that make the sections, in their order; each takes about a second."""
        plans = [self._plans] if self._recording.plans else []
        root = [self._root] if self._recording.layout.has_floating_base else []
        first = [self._result, self._tracking, *root, self._efforts, self._contacts]
        return [*first, *plans, self._events, self._ticks, self._run]

    def sections(self) -> Iterator[Section]:
        """All sections, in their order."""
        return (make() for make in self.makers)

    def _result(self) -> Section:
        pictures, remarks = self._strip()
        sentence = describe_end(float(self._recording.times[-1]), self._facts, self._metrics)
        return Section("", pictures, remarks=remarks, verdict=sentence, tiles=tiles(self._metrics))

    def _strip(self) -> tuple[list[Illustration], list[str]]:
        """The picture of the character, or a note why there is none."""
        recording = self._recording
        if not self._stills:
            return [], []
        has_ghost = bool(np.isfinite(recording.reference_position).all(axis=1).any())
        try:
            poses = strip(recording, self._stills, ghost=has_ghost and bool(recording.layout.size))
        except ActuatedCharactersError as error:
            return [], [f"The character cannot be drawn: {error}"]
        content = BytesIO()
        imsave(content, poses, format="png")
        ghost = "; the reference is the ghost" if has_ghost else ""
        text = f"{recording.character.name}, evenly from the first state to the last{ghost}"
        return [Illustration(self._prefix + "strip", content.getvalue(), text)], []

    def _tracking(self) -> Section:
        title = "tracking error"
        if not self._facts.reference:
            return Section(title, remarks=["The recording has no reference."])
        columns = list(zip(self._names, self._kinds.units, self._errors.T, strict=True))
        rows = [(name, unit, *_statistics(values)) for name, unit, values in columns]
        table = Table(rows, ("joint", "unit", *_STATISTICS), "distance from the reference")
        panels = []
        for column, (name, unit, values) in enumerate(columns):
            panels.append(charts.Panel(f"error ({unit})", {name: values}, name, from_zero=True))
            if unit == "m":
                panels.append(self._position_panel(column))
        text = "distance of root and joints from the reference, positions of sliders, root height"
        return Section(title, [self._series("errors", text, panels, columns=3)], [table])

    def _position_panel(self, column: int) -> charts.Panel:
        """A slider's position, or the root's height, and that of its reference."""
        recording, entry = self._recording, int(self._recording.layout.vector_starts[column])
        title = self._names[column] if self._kinds.sliding[column] else "root height"
        entry += 0 if self._kinds.sliding[column] else 2
        positions = (recording.position[:, entry], recording.reference_position[:, entry])
        lines = dict(zip(("simulated", "reference"), positions, strict=True))
        return charts.Panel("position (m)", lines, title)

    def _efforts(self) -> Section:
        title, recording = "torques against limits", self._recording
        sizes = effort_sizes(recording.layout, recording.effort)
        if np.isnan(sizes).all():
            return Section(title, remarks=["The recording has no efforts."])
        rows = []
        for name, unit, limit, values in zip(
            self._names, self._kinds.units, self._limits, sizes.T, strict=True
        ):
            share = self._facts.saturated_shares.get(name)
            of_ticks = NOT_KNOWN if share is None else f"{100.0 * share:.3g} %"
            kind = {"rad": "N m", "m": "N"}[unit]
            rows.append((name, kind, *_statistics(values), _shown(limit), of_ticks))
        columns = ("joint", "unit", *_STATISTICS, "limit", "at the limit")
        table = Table(rows, columns, "applied efforts, and the share of ticks at the limit")
        shares = limit_shares(sizes, self._limits)
        largest = np.nanmax(np.vstack((shares, np.zeros(len(self._names)))), axis=0)
        near = np.flatnonzero(self._kinds.actuated & (largest > NOMINAL))
        if not len(near):
            return Section(title, tables=[table], remarks=["No effort came near a limit."])
        names = [self._names[row] for row in near]
        figure = charts.effort_chart(self._timeline, shares[:, near], names)
        text = "the largest share of its limit that each joint's effort reached, over time"
        return Section(title, [self._drawn(figure, "efforts", text)], [table])

    def _root(self) -> Section:
        recording = self._recording
        position, desired = recording.position[:, :3], recording.reference_position[:, :3]
        figure = charts.path_chart(self._timeline, position, desired)
        return Section("root path", [self._drawn(figure, "root", "path of the root from above")])

    def _contacts(self) -> Section:
        recording = self._recording
        series = contact_series(recording.character, recording.contacts)
        if series is None:
            remark = (
                "The recording has no contacts: it was recorded with --exclude contacts, or by "
                "another recorder."
            )
            return Section("contacts", remarks=[remark])
        if not series.links:
            return Section("contacts", remarks=["No link touched anything."])
        gravity = gravities(recording)
        weight = recording.character.mass * np.where(gravity > 0.0, gravity, np.nan)
        force = series.vertical_force / weight
        curve = charts.Panel("vertical force / weight", {"vertical force / weight": force})
        chart = charts.contact_chart(self._timeline, series.touching, series.links)
        pictures = [
            self._drawn(chart, "contacts", "links in contact over time"),
            self._series("ground", "vertical force of all contacts", [curve]),
        ]
        rows = [
            (link, f"{100.0 * share:.3g} %")
            for link, share in zip(series.links, series.touching.mean(axis=0), strict=True)
        ]
        table = Table(rows, ("link", "of all ticks"), "links in contact")
        return Section("contacts", pictures, [table])

    def _plans(self) -> Section:
        foreseen = foresight(self._recording)
        rows = [(f"{ahead:.4g}", *_statistics(errors)) for ahead, errors in foreseen.items()]
        caption = "distance of the centre of mass from its prediction by a plan (m)"
        table = Table(rows[:_MOST_LISTED], ("after (s)", *_STATISTICS), caption)
        figure = plan_chart(self._recording, self._timeline.marks)
        text = "predicted and simulated path of the centre of mass, and costs of plans"
        return Section("plans", [self._drawn(figure, "plans", text)], [table])

    def _events(self) -> Section:
        facts, recording = self._facts, self._recording
        steps = wall_steps(recording.published_ns)
        rows = [(e.start, f"episode of {e.duration:.4g} s") for e in facts.episodes]
        rows += [
            (p.start, f"push on {p.link} for {p.duration:.3g} s: {p.impulse:.4g} N s")
            for p in facts.pushes
        ]
        rows += [(throw.start, thrown_line(throw)) for throw in facts.throws]
        rows += [(span.start, mode_line(span)) for span in self._modes]
        rows += [(c.time, c.line) for c in facts.changes]
        rows += [
            (float(recording.times[row]), f"pause of {steps[row]:.3g} s of wall time")
            for row in self._pauses
        ]
        listed = [(f"{time:.4f}", text) for time, text in sorted(rows)]
        remarks = []
        if len(listed) > _MOST_LISTED:
            remarks.append(f"The first {_MOST_LISTED} of {len(listed)}.")
        if not facts.pushes_recorded:
            remarks.append("Pushes were not recorded.")
        table = Table(listed[:_MOST_LISTED], ("time (s)", "event"))
        return Section("events", tables=[table], remarks=remarks)

    def _ticks(self) -> Section:
        title, recording = "tick times", self._recording
        if not recording.has_wall_times:
            remark = "Wall times are not known: log times are simulated, and SQLite has no others."
            return Section(title, remarks=[remark])
        steps = wall_steps(recording.published_ns)
        if not len(steps):
            return Section(title, remarks=["There is one state only."])
        steps[self._pauses] = np.nan
        known, period = 1e3 * steps, pace_period(dict(recording.parameters))
        table_rows = [("wall time from state to state, pauses left out", *_statistics(known))]
        curves, remarks = {"wall time": known}, []
        panels = [charts.Panel("wall time (ms)", curves, is_logarithmic=True)]
        if period:
            late, due = lateness(recording.published_ns, period), np.full(len(steps), 1e3 * period)
            curves["period, for reference"] = due
            of_late = {"lateness": 1e3 * late[1:], "period, for reference": due}
            panels.append(charts.Panel("lateness (ms)", of_late, "behind the schedule"))
            table_rows.append(("lateness", *_statistics(1e3 * late[1:])))
            count = int(late_facts(recording.published_ns, period)["ticks"])
            remarks.append(f"{count} of {len(steps)} ticks began more than a period late.")
        pictures = [
            self._drawn(charts.histogram(known), "histogram", "frequency of tick times"),
            self._series("ticks", "wall time from state to state", panels),
        ]
        return Section(title, pictures, [Table(table_rows, ("ms", *_STATISTICS))], remarks)

    def _run(self) -> Section:
        character, parameters = self._recording.character, self._recording.parameters
        facts = [
            ("character", character.name),
            ("degrees of freedom", str(self._recording.layout.size)),
            ("mass", f"{character.mass:.4g} kg"),
            ("rate", f"{parameters.get('rate')} Hz"),
            ("mode", str(parameters.get("mode", "unknown"))),
            ("law", self._facts.law or "not recorded"),
        ]
        tables = [Table(facts), Table(describe_metrics(self._metrics), caption="figures")]
        if self._facts.gains:
            rows = [
                (row.joint, *map(_shown, (row.p, row.d, row.i, row.limit)))
                for row in self._facts.gains
            ]
            columns = ("joint", "p", "d", "i", "limit")
            tables.append(Table(rows, columns, "the controller's gains and limits at the start"))
        return Section("run", tables=tables)

    def _series(
        self, name: str, text: str, panels: Sequence[charts.Panel], columns: int = 1
    ) -> Illustration:
        figure = charts.series_chart(self._timeline, panels, columns=columns)
        return self._drawn(figure, name, text)

    def _drawn(self, figure: "Figure", name: str, text: str) -> Illustration:
        return Illustration(self._prefix + name, charts.png(figure), text)


def _statistics(values: FloatArray) -> Sequence[str]:
    """Mean, percentile and maximum of a series, NaN left out."""
    known = values[~np.isnan(values)]
    if not len(known):
        return (NOT_KNOWN,) * len(_STATISTICS)
    numbers = (known.mean(), np.percentile(known, _PERCENTILE), known.max())
    return tuple(f"{number:.4g}" for number in numbers)


def _shown(value: float | None) -> str:
    return NOT_KNOWN if value is None or math.isinf(value) else f"{value:.4g}"
