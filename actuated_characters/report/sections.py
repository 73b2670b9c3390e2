"""The sections of a report on one character: what is drawn, what is listed, or why it is not."""

from collections.abc import Sequence
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.image import imsave

from actuated_characters.bags.recording import Recording
from actuated_characters.metrics.error_measures import distances, effort_sizes, limit_shares
from actuated_characters.metrics.recording_metrics import (
    contact_series,
    measure_recording,
    push_spans,
    saturated_shares,
    tracking_errors,
    vectors_of,
)
from actuated_characters.render.stills import strip
from actuated_characters.report import charts
from actuated_characters.report.changes import gains, law, live_changes
from actuated_characters.report.charts import Marks
from actuated_characters.report.facts import episodes, late_facts, pace_period
from actuated_characters.report.page import Illustration, Section, Table
from actuated_characters.report.planning import foresight, plan_chart
from actuated_characters.report.reactions import (
    TRACK,
    mode_line,
    mode_spans,
    throw_marks,
    thrown_line,
)
from actuated_characters.report.timing import lateness, pauses, wall_steps
from msgs_config.arrays import FloatArray
from msgs_config.errors import ActuatedCharactersError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAMES = ("strip", "errors", "efforts", "root", "contacts", "plans", "ticks")
"""Of the pictures, in their order."""

STILLS = 8
"""Pictures of the character, where nothing else is said."""

_DPI = 110
_MOST_LISTED = 200
_PERCENTILE = 95


class CharacterReport:
    """Makes the sections of one recording."""

    def __init__(self, recording: Recording, prefix: str = "", stills: int = STILLS) -> None:
        """`prefix` comes before the names of the pictures; `stills` is how many show poses."""
        self._recording = recording
        self._prefix = prefix
        self._count = stills
        self._vectors = vectors_of(recording.character)
        self._pushes = push_spans(recording)
        self._throws = throw_marks(recording)
        spans = mode_spans(recording)
        self._modes = spans if any(span.mode != TRACK for span in spans) else []
        self._changes = live_changes(recording)
        self._breaks = recording.episode_rows[1:]
        self._pauses = pauses(recording.published_ns)
        self._marks = Marks(
            pushes=[(push.start, push.duration) for push in self._pushes],
            resets=recording.times[self._breaks].tolist(),
            changes=sorted({change.time for change in self._changes}),
            pauses=recording.times[self._pauses].tolist(),
            throws=[throw.start for throw in self._throws],
            modes=[(span.start, span.duration, span.mode) for span in self._modes],
        )

    def sections(self) -> list[Section]:
        """All sections, in their order."""
        return [
            self._overview(),
            self._stills(),
            self._errors(),
            self._efforts(),
            self._root(),
            self._contacts(),
            *([self._plans()] if self._recording.plans else []),
            self._ticks(),
            self._events(),
        ]

    def _overview(self) -> Section:
        recording = self._recording
        character, parameters = recording.character, recording.parameters
        first = recording.controller[0].parameters if recording.controller else {}
        facts = [
            ("character", character.name),
            ("degrees of freedom", str(recording.layout.size)),
            ("mass", f"{character.mass:.4g} kg"),
            ("rate", f"{parameters.get('rate')} Hz"),
            ("mode", str(parameters.get("mode", "unknown"))),
            ("law", law(first) or "not recorded"),
        ]
        measured, _ = measure_recording(recording)
        rows = [(name, _shown(value)) for name, value in measured.items()]
        tables = [Table(facts), Table(rows, caption="figures")]
        if recording.controller:
            tables.append(self._gains())
        return Section("overview", tables=tables)

    def _gains(self) -> Table:
        rows = [
            (row.joint, *map(_shown, (row.p, row.d, row.i, row.limit)))
            for row in gains(self._recording.controller[0].parameters, self._vectors.names)
        ]
        columns = ("joint", "p", "d", "i", "limit")
        return Table(rows, columns, "the controller's gains and limits at the start")

    def _stills(self) -> Section:
        recording = self._recording
        if not self._count:
            return Section("stills", notes=["None were asked for."])
        has_ghost = bool(np.isfinite(recording.reference_position).all(axis=1).any())
        try:
            picture = strip(recording, self._count, ghost=has_ghost and bool(recording.layout.size))
        except ActuatedCharactersError as error:
            return Section("stills", notes=[f"It cannot be drawn: {error}"])
        content = BytesIO()
        imsave(content, picture, format="png")
        ghost = "; the reference is the ghost" if has_ghost else ""
        text = f"{recording.character.name}, evenly from the first state to the last{ghost}"
        still = Illustration(self._prefix + "strip", content.getvalue(), text)
        return Section("stills", [still])

    def _errors(self) -> Section:
        title, recording, vectors = "tracking error", self._recording, self._vectors
        if np.isnan(recording.reference_position).all():
            return Section(title, notes=["The recording has no reference."])
        errors = tracking_errors(recording)
        rows = []
        for name, unit, values in zip(vectors.names, vectors.units, errors.T, strict=True):
            rows.append((name, unit, *_statistics(values)))
        columns = ("joint", "unit", "mean", f"{_PERCENTILE} %", "largest")
        table = Table(rows, columns, "distance from the reference")
        joints = np.flatnonzero(vectors.actuated)
        if not len(joints):
            return Section(title, tables=[table], notes=["There are no joints to draw."])
        figure = charts.error_chart(
            recording.times,
            errors[:, joints],
            [vectors.names[joint] for joint in joints],
            [vectors.units[joint] for joint in joints],
            self._breaks,
            self._marks,
        )
        picture = self._drawn(figure, "errors", "distance of each joint from its reference")
        return Section(title, [picture], [table])

    def _efforts(self) -> Section:
        title, recording, vectors = "torques against limits", self._recording, self._vectors
        sizes = effort_sizes(recording.layout, recording.effort)
        if np.isnan(sizes).all():
            return Section(title, notes=["The recording has no efforts."])
        shares = limit_shares(sizes, vectors.limits)
        at_limit = saturated_shares(shares)
        rows = []
        for row, (name, unit) in enumerate(zip(vectors.names, vectors.effort_units, strict=True)):
            limit = vectors.limits[row]
            of_ticks = f"{100.0 * at_limit[row]:.3g} %" if np.isfinite(limit) else "-"
            rows.append((name, unit, *_statistics(sizes[:, row]), f"{limit:g}", of_ticks))
        columns = ("joint", "unit", "mean", f"{_PERCENTILE} %", "largest", "limit", "at the limit")
        table = Table(
            rows, columns, "efforts that were applied, and in how many ticks at the limit"
        )
        limited = np.flatnonzero(vectors.actuated & np.isfinite(vectors.limits))
        if not len(limited):
            return Section(title, tables=[table], notes=["No joint has a limit."])
        names = [vectors.names[joint] for joint in limited]
        figure = charts.effort_chart(recording.times, shares[:, limited], names, self._marks)
        text = "the largest share of its limit that each joint's effort reached, over time"
        return Section(title, [self._drawn(figure, "efforts", text)], [table])

    def _root(self) -> Section:
        title, recording = "root path", self._recording
        if not recording.layout.has_floating_base:
            return Section(title, notes=["The base is fixed."])
        errors = distances(recording.layout, recording.position, recording.reference_position)[
            :, :2
        ]
        figure = charts.root_chart(
            recording.times,
            recording.position[:, :3],
            recording.reference_position[:, :3],
            errors,
            self._breaks,
            self._marks,
        )
        text = "the root's path from above, its height, and its errors"
        return Section(title, [self._drawn(figure, "root", text)])

    def _contacts(self) -> Section:
        title, recording = "contacts", self._recording
        series = contact_series(recording.character, recording.contacts)
        if series is None:
            note = (
                "The recording has no contacts: it was recorded with --exclude contacts, or by "
                "another recorder."
            )
            return Section(title, notes=[note])
        heavy = recording.character.mass * float(recording.parameters.get("gravity", np.nan))
        figure = charts.contact_chart(
            recording.times, series, heavy if heavy > 0.0 else np.nan, self._marks
        )
        text = "which link touched something when, and what all of them bore"
        rows = [
            (link, f"{100.0 * share:.3g} %")
            for link, share in zip(series.links, series.touching.mean(axis=0), strict=True)
        ]
        table = Table(rows, ("link", "of all ticks"), "links that touched something")
        return Section(title, [self._drawn(figure, "contacts", text)], [table])

    def _plans(self) -> Section:
        foreseen = foresight(self._recording)
        rows = [(f"{ahead:.4g}", *_statistics(errors)) for ahead, errors in foreseen.items()]
        columns = ("after (s)", "mean", f"{_PERCENTILE} %", "largest")
        table = Table(
            rows[:_MOST_LISTED], columns, "centre of mass, off where a plan had foreseen it (m)"
        )
        figure = plan_chart(self._recording, self._marks)
        text = "where each plan was to lead, where it led, and what plans cost"
        return Section("plans", [self._drawn(figure, "plans", text)], [table])

    def _ticks(self) -> Section:
        title, recording = "tick times", self._recording
        steps = wall_steps(recording.published_ns)
        if not len(steps):
            return Section(title, notes=["There is one state only."])
        period = pace_period(dict(recording.parameters))
        late = lateness(recording.published_ns, period) if period else None
        usual = np.delete(steps, self._pauses)
        steps[self._pauses] = np.nan
        figure = charts.tick_chart(recording.times, steps, period, late, self._marks)
        rows = [("wall time from state to state, ms, pauses left out", *_statistics(1e3 * usual))]
        notes = []
        if late is not None:
            rows.append(("lateness, ms", *_statistics(1e3 * late[1:])))
            count = int(late_facts(recording.published_ns, period)["ticks"])
            notes.append(f"{count} of {len(steps)} ticks began more than a period late.")
        table = Table(rows, ("", "mean", f"{_PERCENTILE} %", "largest"))
        text = "wall time from state to state"
        return Section(title, [self._drawn(figure, "ticks", text)], [table], notes)

    def _events(self) -> Section:
        recording = self._recording
        spans = episodes(recording)
        rows = [(e.start, f"episode of {e.duration:.4g} s") for e in spans]
        rows += [
            (p.start, f"push on {p.link} for {p.duration:.3g} s: {p.impulse:.4g} N s")
            for p in self._pushes
        ]
        rows += [(throw.start, thrown_line(throw)) for throw in self._throws]
        rows += [(span.start, mode_line(span)) for span in self._modes]
        rows += [(c.time, f"{c.name}: {c.before} to {c.after}") for c in self._changes]
        rows += [
            (float(recording.times[row]), f"pause of {step:.3g} s of wall time")
            for row, step in zip(
                self._pauses, wall_steps(recording.published_ns)[self._pauses], strict=True
            )
        ]
        listed = [(f"{time:.4f}", text) for time, text in sorted(rows)]
        notes = []
        if len(listed) > _MOST_LISTED:
            notes.append(f"The first {_MOST_LISTED} of {len(listed)}.")
        if not recording.applied_wrench:
            notes.append("Pushes were not recorded.")
        table = Table(listed[:_MOST_LISTED], ("time (s)", "what"))
        return Section("what happened", tables=[table], notes=notes)

    def _drawn(self, figure: "Figure", name: str, text: str) -> Illustration:
        content = BytesIO()
        figure.savefig(content, format="png", dpi=_DPI)
        return Illustration(self._prefix + name, content.getvalue(), text)


def _statistics(values: FloatArray) -> Sequence[str]:
    """Mean, percentile and maximum of what is known of a series."""
    known = values[~np.isnan(values)]
    if not len(known):
        return ("-", "-", "-")
    numbers = (known.mean(), np.percentile(known, _PERCENTILE), known.max())
    return tuple(f"{number:.4g}" for number in numbers)


def _shown(value: object) -> str:
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
