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
    for point in found.points:
        if not point.tried:
            continue
        boundary, row = found.boundary(point), point.end(found.boundary(point))
        records.append(
            {
                "point": point.number,
                **point.cells,
                "holds": boundary.holds,
                "fails": boundary.fails,
                "holes": " ".join(map(cell_text, boundary.holes)) or None,
                "tries": len(point.tried),
                "row": row.number,
                "state_hash": done[row.number].outcome.state_hash or None,
                "error": point.error or done[row.number].outcome.error or None,
            }
        )
    return records


def write_boundary(directory: Path, found: Survey, done: Mapping[int, Done]) -> None:
    """Write `boundary.csv`.

    Raises:
        RecordingError: it cannot be written.
    """
    write_whole(directory / BOUNDARY, csv_text(boundary_records(found, done)))
