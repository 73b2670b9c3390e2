"""The films on the documentation's first page: `python -m benchmarks.gallery`.

Each is of a command that stands in a page. It runs as written, in a folder of its own, and `render`
makes the film of its recording. That takes some minutes; `--only fall` makes one.
"""

import argparse
import os
import shlex
import sys
from contextlib import chdir
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from actuated_characters.cli import main as actuated_characters

PROGRAM = "actuated_characters"
LOOK = ("--fps", "16", "--size", "360x260")


class Film(NamedTuple):
    """A film of a documented command."""

    command: str  # as in the pages, without the program's folder
    run: str  # the folder of its results
    look: tuple[str, ...] = ()  # options of `render`, beside those of all films


GALLERY = {
    "fall": Film(
        f"{PROGRAM} run --clip walk --behaviour active_ragdoll --duration 8"
        ' --throw "mass=5 speed=8 at=1.0 target=chest"',
        "runs/humanoid-walk",
        ("--ghost", "none"),
    ),
    "walk": Film(
        f'{PROGRAM} run --machine walk --cmd-vel "0.9,0,0.3@1" --duration 10',
        "runs/humanoid-walk",
        ("--from", "1", "--to", "5"),
    ),
}
"""By the film's name in docs/pictures, without `gallery_` and `.webp`."""


def main() -> int:
    """Simulate, draw and write; 1 if a command fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path("docs/pictures"), help="(%(default)s)")
    parser.add_argument("--only", choices=tuple(GALLERY), help="the film to make (all)")
    options = parser.parse_args()
    folder = options.folder.absolute()
    for name, film in GALLERY.items():
        if options.only in (None, name):
            make_film(film, folder / f"gallery_{name}.webp")
    return 0


def make_film(film: Film, file: Path) -> None:
    """Run a command in an empty folder, and film it. Raises RuntimeError where either fails."""
    with TemporaryDirectory(prefix="gallery-") as folder, chdir(folder):
        os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        for command in (
            shlex.split(film.command)[1:],
            ["render", film.run, "--output", str(file), *LOOK, *film.look],
        ):
            if actuated_characters(command):
                raise RuntimeError(f"{shlex.join(command)} failed")


if __name__ == "__main__":
    sys.exit(main())
