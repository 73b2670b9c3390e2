"""The sections of a report on one character: verdict, errors, efforts, contacts and events."""

import math
from collections.abc import Callable, Sequence
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.image import imsave

from actuated_characters.bags.recording import Recording
from actuated_characters.metrics.error_measures import effort_sizes, limit_shares, vector_kinds
from actuated_characters.metrics.recording_metrics import (
    contact_series,
    measure_recording,
    push_spans,
    saturated_shares,
    tracking_errors,
)
from actuated_characters.render.stills import strip
from actuated_characters.report import charts
from actuated_characters.report.events import Event, find_events
from actuated_characters.report.metrics_plot import NOMINAL
from actuated_characters.report.page import NOT_KNOWN, Illustration, Section, Table
from actuated_characters.report.verdict import describe_end, describe_law, tiles
from msgs_config.arrays import FloatArray
from msgs_config.errors import ActuatedCharactersError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAMES = ("strip", "errors", "efforts", "contacts")
"""Names of the pictures of a run."""

STILLS = 8
"""Default number of poses in the picture of the character."""

_MOST_LISTED = 200
_PERCENTILE = 95
_STATISTICS = ("mean", f"{_PERCENTILE} %", "largest")


class CharacterReport:
    """Makes the sections of one recording."""

    def __init__(
        self, recording: Recording, prefix: str = "", stills: int = STILLS, chapter: str = ""
    ) -> None:
        """`prefix` comes before names of pictures; `stills` are poses; `chapter` is a heading."""
        self._recording, self._prefix, self._stills = recording, prefix, stills
        self._chapter = chapter
        reference = recording.reference_position
        self._has_reference = bool(np.isfinite(reference).all(axis=1).any())
        self._kinds = vector_kinds(recording.layout)
        self._names = recording.character.vector_names
        self._events = self._measured_events()
        marks, breaks = charts.Marks(self._events), recording.episode_rows[1:]
        self._timeline = charts.Timeline(recording.times, breaks, marks)

    def _measured_events(self) -> list[Event]:
        """Measure the run; return what happened in it."""
        self._metrics, _ = measure_recording(self._recording)
        fell_at = self._metrics["fell_at_s"]
        return find_events(self._recording, fell_at if isinstance(fell_at, float) else None)

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
        """Functions that make the sections, in their order."""
        return [self._result, self._tracking, self._efforts, self._contacts, self._listed_events]

    def _result(self) -> Section:
        pictures, remarks = self._strip()
        verdict, shown = self._verdict(), self._tiles()
        return Section("", pictures, [], remarks, verdict, shown, self._chapter)

    def _verdict(self) -> str:
        controller = self._recording.controller
        law = describe_law(controller[0].parameters) if controller else None
        return describe_end(self._metrics, law, has_reference=self._has_reference)

    def _tiles(self) -> list[tuple[str, str]]:
        return tiles(self._metrics)

    def _strip(self) -> tuple[list[Illustration], list[str]]:
        """The picture of the character, or a note why there is none."""
        recording = self._recording
        if not self._stills:
            return [], []
        try:
            has_ghost = self._has_reference and bool(recording.layout.size)
            poses = strip(recording, self._stills, ghost=has_ghost)
        except ActuatedCharactersError as error:
            return [], [f"The character cannot be drawn: {error}"]
        content = BytesIO()
        imsave(content, poses, format="png")
        ghost = "; the reference is the ghost" if self._has_reference else ""
        pushes = ", pushes while they act" if push_spans(recording) else ""
        text = f"{recording.character.name}, evenly from the first state to the last{pushes}{ghost}"
        return [Illustration(self._prefix + "strip", content.getvalue(), text)], []

    def _tracking(self) -> Section:
        title, errors = "tracking error", tracking_errors(self._recording)
        if np.isnan(errors).all():
            own = "Its reference is where it was itself, which tells no error."
            remark = own if self._has_reference else "The recording has no reference."
            return Section(title, remarks=[remark])
        columns = list(zip(self._names, self._kinds.units, errors.T, strict=True))
        rows = [(name, unit, *_statistics(values)) for name, unit, values in columns]
        table = Table(rows, ("joint", "unit", *_STATISTICS), "distance from the reference")
        panels = [
            charts.Panel(f"error ({unit})", {name: values}, name, from_zero=True)
            for name, unit, values in columns
        ]
        figure = charts.series_chart(self._timeline, panels)
        picture = self._drawn(figure, "errors", "distance of root and joints from the reference")
        return Section(title, [picture], [table])

    def _efforts(self) -> Section:
        title, recording = "torques against limits", self._recording
        sizes = effort_sizes(recording.layout, recording.effort)
        if np.isnan(sizes).all():
            return Section(title, remarks=["The recording has no efforts."])
        limits = recording.character.effort_limits()
        shares, rows = limit_shares(sizes, limits), []
        for name, unit, limit, at_limit, values in zip(
            self._names, self._kinds.units, limits, saturated_shares(shares), sizes.T, strict=True
        ):
            kind = {"rad": "N m", "m": "N"}[unit]
            limited = (NOT_KNOWN, NOT_KNOWN)
            if math.isfinite(limit):
                limited = (f"{limit:.4g}", f"{100.0 * at_limit:.3g} %")
            rows.append((name, kind, *_statistics(values), *limited))
        columns = ("joint", "unit", *_STATISTICS, "limit", "at the limit")
        table = Table(rows, columns, "applied efforts, and the share of ticks at the limit")
        largest = np.nanmax(np.vstack((shares, np.zeros(len(self._names)))), axis=0)
        near = np.flatnonzero(self._kinds.actuated & (largest > NOMINAL))
        if not len(near):
            return Section(title, tables=[table], remarks=["No effort came near a limit."])
        names = [self._names[row] for row in near]
        figure = charts.effort_chart(self._timeline, shares[:, near], names)
        text = "the largest share of its limit that each joint's effort reached, over time"
        return Section(title, [self._drawn(figure, "efforts", text)], [table])

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
        figure = charts.contact_chart(self._timeline, series.touching, series.links)
        rows = [
            (link, f"{100.0 * share:.3g} %")
            for link, share in zip(series.links, series.touching.mean(axis=0), strict=True)
        ]
        table = Table(rows, ("link", "of all ticks"), "links in contact")
        picture = self._drawn(figure, "contacts", "links in contact over time")
        return Section("contacts", [picture], [table])

    def _listed_events(self) -> Section:
        rows = [(f"{event.start:.4f}", event.text) for event in self._events]
        remarks = [] if rows else ["There were none."]
        if len(rows) > _MOST_LISTED:
            remarks.append(f"The first {_MOST_LISTED} of {len(rows)}.")
        if not self._recording.applied_wrench:
            remarks.append("Pushes were not recorded.")
        tables = [Table(rows[:_MOST_LISTED], ("time (s)", "event"))] if rows else []
        return Section("events", tables=tables, remarks=remarks)

    def _drawn(self, figure: "Figure", name: str, text: str) -> Illustration:
        return Illustration(self._prefix + name, charts.png(figure), text)


def _statistics(values: FloatArray) -> Sequence[str]:
    """Mean, percentile and maximum of a series, NaN left out."""
    known = values[~np.isnan(values)]
    if not len(known):
        return (NOT_KNOWN,) * len(_STATISTICS)
    numbers = (known.mean(), np.percentile(known, _PERCENTILE), known.max())
    return tuple(f"{number:.4g}" for number in numbers)
