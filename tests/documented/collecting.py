"""Collects the commands that the project tells its users: pages, help, overview, scenes, examples.

A command is a line of a block of shell, or a span of code that is whole: it begins with the program
that it runs. A block with jobs in the background is one command, a script.
"""

import argparse
import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from actuated_characters.cli import _parser
from actuated_characters.commands.common.overview import OVERVIEW
from actuated_characters.scenes.scene import scene_names

ROOT = Path(__file__).parents[2]
PAGES = [
    *(ROOT / "README.md", ROOT / "CONTRIBUTING.md"),
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "docs/coming_from").glob("*.md")),
]
MADE = "documented.md"  # the page that lists the commands, made from them

_BLOCK = re.compile(r"^```sh\n(.*?)^```", re.MULTILINE | re.DOTALL)
_INDENTED = re.compile(r"^    (\.venv/bin/.*)$", re.MULTILINE)
_WHOLE = re.compile(
    r"`((?:\.venv/bin/|actuated_characters \w|python -m |make [a-z]|(?:run|play|study) -?\w)[^`]*)`"
)
_PROGRAM = "actuated_characters"


@dataclass(frozen=True)
class Documented:
    """A command, and the first place that has it."""

    command: str  # one line without a comment; of a script its lines
    page: str  # relative to the project, or what printed it


def collect() -> dict[str, list[str]]:
    """Where each command stands, by its text, in the order in which a reader meets them."""
    found: dict[str, list[str]] = {}
    for each in (*_of_pages(), *_of_help(), *_of_overview(), *_of_scenes(), *_of_examples()):
        places = found.setdefault(each.command, [])
        if each.page not in places:
            places.append(each.page)
    return found


def _of_pages() -> Iterator[Documented]:
    for page in PAGES:
        if page.name == MADE:
            continue
        text, name = page.read_text(encoding="utf-8"), str(page.relative_to(ROOT))
        for block in _BLOCK.findall(text):
            yield from (Documented(command, name) for command in commands_of(block))
        for line in _INDENTED.findall(text):
            yield Documented(_plain(line), name)
        for span in _WHOLE.findall(_BLOCK.sub("", text)):
            if not span.startswith(("run --", "play --", "study -")):  # else an option is named
                yield Documented(re.sub("^study ", f"{_PROGRAM} study ", _plain(span)), name)


def commands_of(block: str) -> list[str]:
    """The commands of a block of shell: its lines, or all of it where one runs beside others."""
    lines = [_plain(line) for line in block.replace("\\\n", " ").splitlines()]
    lines = [line for line in lines if line]
    if any(line.endswith("&") or line.startswith(("cd ", "source ")) for line in lines):
        return ["\n".join(lines)]
    return lines


def _plain(line: str) -> str:
    """A line without its comment and its program's folder, its spaces single ones."""
    line = re.sub(r"\s+#.*$|^#.*$", "", line)
    line = line.removeprefix(".venv/bin/")
    return re.sub(r"\s+", " ", line).strip()


def _of_help() -> Iterator[Documented]:
    for parser in _parsers(_parser()):
        _, _, examples = re.sub(r"\s+", " ", parser.epilog or "").partition("example")
        for example in examples.lstrip("s: ").split(";"):
            if example.strip():
                yield Documented(example.strip(), f"{parser.prog} --help")


def _parsers(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """A parser, and those of all commands below it."""
    yield parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for below in action.choices.values():
                yield from _parsers(below)


def _of_overview() -> Iterator[Documented]:
    for words in OVERVIEW:
        yield Documented(f"{_PROGRAM} {words}", f"{_PROGRAM} run")


def _of_scenes() -> Iterator[Documented]:
    for name in scene_names():
        yield Documented(f"{_PROGRAM} play --scene {name}", f"scene {name}")


def _of_examples() -> Iterator[Documented]:
    for file in sorted((ROOT / "examples").glob("*.py")):
        text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
        lines = re.findall(r"^    (\.venv/bin/.*)$", text.replace("\\\n", " "), re.MULTILINE)
        if lines:
            yield Documented("\n".join(map(_plain, lines)), f"examples/{file.name}")
