"""The table of a search: a line for each point."""

from collections.abc import Mapping
from pathlib import Path

from actuated_characters.boundary.survey import Survey
from actuated_characters.sweep.grid import cell_text
from actuated_characters.sweep.journal import Done
from actuated_characters.sweep.table import Record, csv_text
from msgs_config.whole_files import write_whole

BOUNDARY = "boundary.csv"


def boundary_records(found: Survey, done: Mapping[int, Done]) -> list[Record]:
    """What is known of each point that was begun: its boundary, and the run whose bag shows it."""
    records: list[Record] = []
    shown = found.shown()
    for point in found.points:
        if not point.tried:
            continue
        boundary = found.boundary(point)
        whole = done.get(shown[point.number][1].number) if point.number in shown else None
        records.append(
            {
                "point": point.number,
                **point.cells,
                "holds": boundary.holds,
                "fails": boundary.fails,
                "holes": " ".join(map(cell_text, boundary.holes)) or None,
                "tries": len(point.tried),
                "row": whole.number if whole else None,
                "state_hash": (whole.outcome.state_hash or None) if whole else None,
                "error": point.error or (whole and whole.outcome.error) or None,
            }
        )
    return records


def write_boundary(directory: Path, found: Survey, done: Mapping[int, Done]) -> None:
    """Write `boundary.csv`.

    Raises:
        RecordingError: it cannot be written.
    """
    write_whole(directory / BOUNDARY, csv_text(boundary_records(found, done)))
