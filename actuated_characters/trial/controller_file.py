"""The file of a controller on trial: how it is started, and what it needs."""

import hashlib
import shutil
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from shlex import split
from typing import Any

from actuated_characters.runs.foreign_controller import PLACE, PLACES, ForeignController, fill
from actuated_characters.sweep.journal import is_file
from msgs_config.digests import sha256_of
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.file_kinds import refuse_other_kind
from msgs_config.files import parse_yaml_mapping, read_text
from msgs_config.mappings import MappingReader

_KEYS = (
    *("name", "trials", "command", "controller_node", "build", "environment"),
    *("subscriptions", "start_timeout", "run", "set"),
)
_START_TIMEOUT = 120.0  # s
_MOST_SUBSCRIPTIONS = 100


@dataclass(frozen=True)
class Controller:
    """A controller on trial."""

    name: str
    folder: Path  # where its commands run
    trials: str  # the set that it is for; empty: not said
    foreign: ForeignController | None  # None: this project's own controller_node
    build: tuple[str, ...]  # a command that is run once before; empty: none
    start_timeout: float  # s until its first answer
    run: Mapping[str, object] = field(default_factory=dict)  # options of `run` that it needs
    set: Mapping[str, object] = field(default_factory=dict)  # parameters that it needs

    def digests(self) -> dict[str, str]:
        """SHA-256 of the files that its command names, by their words in it; not of this Python."""
        command = () if self.foreign is None else self.foreign.command
        places = {"folder": str(self.folder)}
        files = {word: self.folder / fill(word, places) for word in command}
        return {word: sha256_of(path) for word, path in files.items() if is_file(path)}

    def fingerprint(self) -> str:
        """A few letters that are others if what is started is another one, or in another way."""
        started = (self.foreign, self.start_timeout, self.run, self.set, self.digests())
        return hashlib.sha256(repr(started).encode()).hexdigest()[:12]


def read_controller(path: Path, folder: Path | None = None) -> Controller:
    """Read a controller's file; its commands run in `folder`, by default in its own.

    Raises:
        ConfigurationError: something in it is wrong; names the place, and what would be right.
    """
    refuse_other_kind(path, "a controller", (".yaml", ".yml"), ConfigurationError)
    content = parse_yaml_mapping(path, read_text(path, ConfigurationError), ConfigurationError)
    reader = MappingReader(path, content, ConfigurationError)
    reader.check_keys(_KEYS)
    given = [key for key in ("command", "controller_node") if content.get(key) is not None]
    if len(given) != 1:
        raise ConfigurationError(
            f"{path}: it must have either 'command', which starts a controller, or "
            "'controller_node', options of `run` for this project's own"
        )
    own_options = reader.part("controller_node").content
    run = {**reader.part("run").content}
    for name in own_options.keys() & run.keys():
        raise ConfigurationError(f"{path}: controller_node.{name} is in run, too; give it once")
    folder = folder or path.absolute().parent
    return Controller(
        name=reader.text("name") if "name" in content else path.stem,
        folder=folder,
        trials=reader.text("trials") if "trials" in content else "",
        foreign=_foreign(reader, folder),
        build=_words(reader, "build"),
        start_timeout=reader.number("start_timeout", _START_TIMEOUT, minimum=0.1, maximum=1e6),
        run={**run, **own_options},
        set=reader.part("set").content,
    )


def _foreign(reader: MappingReader, folder: Path) -> ForeignController | None:
    if reader.content.get("command") is None:
        for key in ("environment", "subscriptions"):
            if key in reader.content:
                raise ConfigurationError(f"{reader.place}: {key} goes with 'command'")
        return None
    command = _words(reader, "command")
    environment = reader.part("environment").content
    for name, value in environment.items():
        if not isinstance(value, str):
            raise reader.wrong(f"environment.{name}", value, "a text")
    count: Any = reader.content.get("subscriptions", 1)
    if type(count) is not int or not 1 <= count <= _MOST_SUBSCRIPTIONS:
        raise reader.wrong(
            "subscriptions", count, f"a whole number from 1 to {_MOST_SUBSCRIPTIONS}"
        )
    return ForeignController(command, folder, environment, count)


def _words(reader: MappingReader, key: str) -> tuple[str, ...]:
    """The words of a command, given as a list or as a text as a shell splits it."""
    value = reader.content.get(key)
    if value is None:
        return ()
    try:
        words = split(value) if isinstance(value, str) else value
    except ValueError as error:
        raise reader.wrong(key, value, f"a command ({error})") from error
    if not isinstance(words, list) or not words or not all(isinstance(each, str) for each in words):
        raise reader.wrong(key, value, "a command: a text, or a list of texts")
    for name in (name for word in words for name in PLACE.findall(word)):
        if name not in PLACES and get_close_matches(name, PLACES):
            raise ConfigurationError(
                f"{reader.place}: {key}: {one_of('place', name, list(PLACES))}"
            )
    return tuple(words)


def check_program(path: Path, controller: Controller) -> None:
    """Check, when everything is built, that there is the program of a controller.

    Raises:
        ConfigurationError: there is none.
    """
    if controller.foreign is None:
        return
    folder = controller.folder
    program = fill(controller.foreign.command[0], {"python": sys.executable, "folder": str(folder)})
    found = shutil.which(str(folder / program) if "/" in program else program)
    if found is None:
        raise ConfigurationError(
            f"{path}: there is no program '{program}' (of {', '.join(PLACES)} in braces; a path is "
            f"relative to {folder})"
        )
