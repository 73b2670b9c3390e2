"""Files of ten makers imported as clips, and how well a character tracks them.

`python -m benchmarks.motion` makes the files in a temporary folder; with names of BVH files it
takes these. `--planner` tracks the clips by joint torques alone, too.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from benchmarks.planner.clips import Attempt, Task, attempt
from character_motion.clips.importing import ImportedClip, import_bvh
from character_motion.retargeting.target_body import TargetBody
from msgs_config.character.loading import load_character
from msgs_config.errors import ActuatedCharactersError
from tests.support.capture_makers import MAKERS, TEN_FILES
from tests.support.captures import capture

_COLUMNS = (
    *("file", "Hz", "s", "up, unit, rest", "in ground, mm", "skating, cm/s", "95 % below"),
    *("worst joint, rad", "tracked, rad", "planned, rad", "to the end"),
)
_ASSISTED = ("controller_node.planner:=none",)


def main() -> int:
    """Import files, track their clips, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="*", type=Path, help="BVH files (ten that are made)")
    parser.add_argument("--character", default="humanoid", help="(%(default)s)")
    parser.add_argument("--planner", action="store_true", help="without root assistance, too")
    parser.add_argument("--seed", type=int, default=1, help="of the planner (%(default)s)")
    options = parser.parse_args()
    with TemporaryDirectory() as folder:
        try:
            _print_table(options, Path(folder))
        except ActuatedCharactersError as error:
            raise SystemExit(f"error: {error}") from error
    return 0


def _print_table(options: argparse.Namespace, folder: Path) -> None:
    target, console = TargetBody(load_character(options.character)), Console(width=170)
    files = options.files or [
        capture(folder / f"{maker}_{clip}.bvh", MAKERS[maker], clip) for maker, clip in TEN_FILES
    ]
    table = Table(title=f"clips of {options.character}", title_justify="left")
    for number, column in enumerate(_COLUMNS):
        table.add_column(column, justify="right" if number else "left")
    tracked = []
    for number, file in enumerate(track(files, console=console)):
        made = import_bvh(file, target)
        clip = folder / f"{number}_{file.stem}.json"
        made.clip.write(clip)
        results = [_attempt(options, clip, _ASSISTED)]
        if options.planner:
            results.append(_attempt(options, clip, ()))
        tracked.append(results[0].joint_error)
        table.add_row(file.stem, *_row(made, results))
    console.print(table)
    print(f"tracked: median {np.median(tracked):.3f} rad, largest {max(tracked):.3f} rad")


def _attempt(options: argparse.Namespace, clip: Path, settings: tuple[str, ...]) -> Attempt:
    name = options.character
    return attempt(Task(name, name, str(clip), options.seed, None, settings, ()))


def _row(made: ImportedClip, results: Sequence[Attempt]) -> list[str]:
    quality, conventions = made.quality, made.retargeted.conventions
    skating = [
        "-" if value is None else f"{100 * value:.2f}"
        for value in (quality.skating_mean_m_s, quality.skating_p95_m_s)
    ]
    row = [
        f"{made.clip.rate:.4g}",
        f"{made.clip.duration:.2f}",
        f"{conventions.up}, {conventions.unit}, {conventions.rest}",
        f"{1e3 * max(quality.feet_in_ground_m, 0.0):.1f}",
        *skating,
        f"{made.worst_joint} {made.worst_mean_rad:.2f}",
        f"{results[0].joint_error:.3f}",
    ]
    if len(results) > 1:
        lost_at = results[1].lost_at
        row += [
            f"{results[1].joint_error:.3f}",
            "yes" if lost_at is None else f"lost at {lost_at:.2f} s",
        ]
    return row


if __name__ == "__main__":
    sys.exit(main())
