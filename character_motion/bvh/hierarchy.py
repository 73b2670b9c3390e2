"""Parser of the hierarchy at the beginning of a BVH file."""

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from character_motion.bvh.skeleton import CHANNELS, EndSite, Skeleton
from msgs_config.errors import ClipError, one_of

Offset3 = tuple[float, float, float]

LARGEST = 1e9
"""Of any number in a file; a rotation may be of many turns."""
_MOST_JOINTS = 1024
_MAX_SHOWN = 60  # characters of a line
_CHANNEL_NAMES = {name.lower(): name for name in CHANNELS}


def wrong_line(path: Path, number: int, found: str, right: str) -> ClipError:
    """The error for a line by its number: what is there, and what must be."""
    shown = "the end of the file" if not found else repr(found[:_MAX_SHOWN])
    return ClipError(f"{path}, line {number}: {shown}; there must be {right}")


def parse_number(text: str) -> float:
    """A decimal number of at most `LARGEST`; NaN for anything else."""
    try:
        value = float(text)
    except ValueError:
        return math.nan
    return value if abs(value) <= LARGEST else math.nan


@dataclass
class _JointLines:
    """A joint, or an end site, which has no name, while it is read."""

    name: str
    parent: int
    line: int
    offset: Offset3 | None = None
    channels: tuple[str, ...] | None = None


@dataclass
class HierarchyParser:
    """Takes the statements of a hierarchy, one after the other."""

    path: Path
    _nodes: list[_JointLines] = field(default_factory=list)
    _open: list[int] = field(default_factory=list)  # nodes whose braces are open, the last inside
    _has_begun: bool = False
    _awaits_brace: bool = False

    def take(self, number: int, line: str) -> bool:
        """Take a line by its number; returns False at the line MOTION, after the hierarchy."""
        for part in line.replace("{", "\n{\n").replace("}", "\n}\n").splitlines():
            statement = part.strip()
            if statement.upper() == "MOTION" and self._nodes and not self._open:
                return False
            if statement:
                self._take(number, statement)
        return True

    def skeleton(self) -> Skeleton:
        """The skeleton, once the hierarchy is complete."""
        joints = [k for k, node in enumerate(self._nodes) if node.name]
        index = {node: k for k, node in enumerate(joints)}
        return Skeleton(
            names=tuple(self._nodes[k].name for k in joints),
            parents=tuple(index.get(self._nodes[k].parent, -1) for k in joints),
            offsets=np.array([self._nodes[k].offset for k in joints]),
            channels=tuple(self._nodes[k].channels or () for k in joints),
            end_sites=tuple(
                EndSite(index[node.parent], node.offset)
                for node in self._nodes
                if not node.name and node.offset is not None
            ),
        )

    def _take(self, number: int, statement: str) -> None:
        keyword, *words = statement.split()
        keyword = keyword.upper()
        if not self._has_begun:
            self._has_begun = keyword == "HIERARCHY"
            if not self._has_begun:
                raise wrong_line(self.path, number, statement, "HIERARCHY: it is no BVH file")
        elif self._awaits_brace:
            self._awaits_brace = False
            if keyword != "{":
                raise wrong_line(self.path, number, statement, "{ after the name of a joint")
        elif keyword == "ROOT" and not self._nodes:
            self._begin(number, statement, -1)
        elif keyword == "JOINT" and self._innermost_name:
            self._begin(number, statement, self._open[-1])
        elif statement.upper().split()[:2] == ["END", "SITE"] and self._innermost_name:
            self._begin(number, "", self._open[-1])
        elif keyword == "OFFSET" and self._open:
            self._nodes[self._open[-1]].offset = self._offset(number, statement, words)
        elif keyword == "CHANNELS" and self._innermost_name:
            self._nodes[self._open[-1]].channels = self._channels(number, statement, words)
        elif keyword == "}" and self._open:
            self._end(number)
        else:
            right = "one ROOT with its JOINTs, each with OFFSET, CHANNELS and braces, then MOTION"
            raise wrong_line(self.path, number, statement, right)

    @property
    def _innermost_name(self) -> str:
        """The name of the joint that is open; empty if there is none, or an end site."""
        return self._nodes[self._open[-1]].name if self._open else ""

    def _begin(self, number: int, statement: str, parent: int) -> None:
        _, _, name = statement.partition(statement.split()[0]) if statement else ("", "", "")
        name = name.strip()
        if statement and not name:
            raise wrong_line(self.path, number, statement, "a name after it")
        if name and any(node.name == name for node in self._nodes):
            raise wrong_line(self.path, number, statement, "a name that no other joint has")
        if len(self._nodes) == _MOST_JOINTS:
            raise wrong_line(self.path, number, statement, f"at most {_MOST_JOINTS} joints")
        self._open.append(len(self._nodes))
        self._nodes.append(_JointLines(name, parent, number))
        self._awaits_brace = True

    def _end(self, number: int) -> None:
        node = self._nodes[self._open.pop()]
        named = f"joint '{node.name}'" if node.name else "the end site"
        if node.offset is None:
            raise wrong_line(self.path, number, "}", f"OFFSET in {named} of line {node.line}")
        if node.name and node.channels is None:
            raise wrong_line(self.path, number, "}", f"CHANNELS in {named} of line {node.line}")

    def _offset(self, number: int, statement: str, words: list[str]) -> Offset3:
        values = [parse_number(word) for word in words]
        if len(values) != 3 or any(map(math.isnan, values)):
            raise wrong_line(self.path, number, statement, "three numbers after OFFSET")
        return values[0], values[1], values[2]

    def _channels(self, number: int, statement: str, words: list[str]) -> tuple[str, ...]:
        for word in words[1:]:
            if word.lower() not in _CHANNEL_NAMES:
                sentence = one_of("channel", word, list(CHANNELS))
                raise ClipError(f"{self.path}, line {number}: {sentence}")
        names = tuple(_CHANNEL_NAMES[word.lower()] for word in words[1:])
        if not words or words[0] != str(len(names)) or len(set(names)) < len(names):
            right = "CHANNELS, their number, and as many different names"
            raise wrong_line(self.path, number, statement, right)
        return names
