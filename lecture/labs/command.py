"""The command `actuated_characters grade`: the lecture's exercises, graded by exact figures."""

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from actuated_characters.commands.common.progress import progress_bar, say
from actuated_characters.commands.common.settings import Commands, add_command
from actuated_characters.commands.common.tables import make_table
from lecture.labs.catalogue import LABS, load_lab, stub_of
from msgs_config.errors import ConfigurationError

if TYPE_CHECKING:  # it takes a while to import
    from lecture.labs.sheet import Sheet


def add_grade(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    command = add_command(
        commands,
        _grade,
        "grade",
        "grade a student's file of one of the lecture's exercises",
        "Simulate with the functions of a student's file, and give points for exact figures: "
        "those of the case that the exercise shows, and of hidden ones. The same file gets the "
        "same points on every machine. docs/labs.md tells what each lab asks.",
        ["grade lab1 --stub my.py", "grade lab1 my.py"],
    )
    command.add_argument("lab", choices=LABS, metavar="LAB", help=", ".join(LABS))
    command.add_argument("file", type=Path, nargs="?", metavar="FILE.py", help="the student's file")
    command.add_argument(
        "--stub", type=Path, metavar="FILE.py", help="write the file to begin with, and end"
    )
    command.add_argument("--json", action="store_true", help="print JSON instead of a table")


def _grade(options: argparse.Namespace) -> None:
    if options.stub is not None:
        _write_stub(options.lab, options.stub)
        return
    if options.file is None:
        raise ConfigurationError(
            f"grade {options.lab}: which file? `grade {options.lab} --stub my.py` makes one to "
            "begin with"
        )
    from lecture.labs.sheet import FULL, Sheet
    from lecture.labs.student import Student

    lab, sheet = load_lab(options.lab), Sheet()
    with (
        progress_bar(options.lab, float(FULL), "points", transient=True) as bar,
        Student(options.file) as student,
    ):
        sheet.report = lambda judged: bar.update(bar.task_ids[0], completed=judged)
        lab.grade(student, sheet)
    if options.json:
        print(json.dumps(sheet.as_json(options.lab), indent=2))
    else:
        _show(f"{options.lab}: {lab.TITLE}", options.lab, sheet)


def _write_stub(lab: str, path: Path) -> None:
    try:
        with path.open("xb") as file:
            file.write(stub_of(lab))
    except FileExistsError as error:
        raise ConfigurationError(f"{path} exists; --stub writes a new file") from error
    print(f"{path}: fill it in, then `actuated_characters grade {lab} {path}`")


def _show(title: str, lab: str, sheet: "Sheet") -> None:
    from lecture.labs.sheet import FULL

    rows = [
        [each.what, each.asked, each.measured, f"{each.points} of {each.of}"]
        for each in sheet.criteria
    ]
    Console().print(
        make_table(title, ("criterion", "asked", "measured", "points"), rows, right=False)
    )
    for error in sheet.errors:
        say(f"error: {error}")
    print(f"{lab}: {sheet.points} of {FULL} points; states {sheet.state_hash[:16]}")
