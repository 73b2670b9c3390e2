"""What a documented command promises: the records of promises.yaml."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import yaml

from lecture.framework.catalogue import NAMES

FILE = Path(__file__).with_name("promises.yaml")
_OF_ROS = ("ros2 ", "rviz2 ", "source /opt/ros/")  # the wheels have no such programs


@dataclass(frozen=True)
class Promise:
    """What is seen of a command that keeps its word; promises.yaml explains each field."""

    cheap: bool = False
    long: bool = False
    given: tuple[str, ...] = ()
    words: Mapping[str, str] = field(default_factory=dict)  # `for`
    ends_after: float = 0.0
    exits: int = 0
    page: bool = False
    run: str = ""
    height: tuple[float, float] | None = None
    tilt: float | None = None
    travels: tuple[float, float] | None = None
    airborne: float | None = None
    fell: bool | None = None
    error: float | None = None
    same_as: str = ""  # `as`
    makes: tuple[str, ...] = ()
    says: str = ""
    tested_by: str = ""
    elsewhere: str = ""

    @property
    def is_tried(self) -> bool:
        """Whether the table itself runs it."""
        return not self.tested_by and not self.elsewhere


_NAMES = {"for": "words", "as": "same_as"}
_KNOWN = {each.name for each in fields(Promise)}


def read_promises() -> dict[str, Promise]:
    """The promises by command, those of the studies too. Raises ValueError where a key is none."""
    content = yaml.safe_load(FILE.read_text(encoding="utf-8"))
    written = {
        str(command).rstrip("\n"): _promise(command, given) for command, given in content.items()
    }
    studies = {
        f"actuated_characters study {name}": Promise(makes=(f"studies/{name}",)) for name in NAMES
    }
    return studies | written


def _promise(command: str, given: Mapping[str, Any]) -> Promise:
    values = {_NAMES.get(name, name): value for name, value in given.items()}
    if values.keys() - _KNOWN:
        raise ValueError(f"{command}: no such key: {', '.join(sorted(values.keys() - _KNOWN))}")
    values = {name: tuple(v) if isinstance(v, list) else v for name, v in values.items()}
    return Promise(**values)


def promise_of(command: str, promises: Mapping[str, Promise]) -> Promise | None:
    """The promise of a command; None where it has none, and so must not be documented."""
    if command.startswith(_OF_ROS):
        return Promise(elsewhere="it needs a ROS 2 install, which the wheels are not")
    return promises.get(command)
