"""What a search has found so far, in a file beside its result, so that it can be resumed."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from controller_node.feedback_gains import checked_gains
from controller_node.references.corrected_file import write_whole
from experiment.samcon.gain_space import Gains
from experiment.samcon.search import Progress
from experiment.samcon.tree import Node
from msgs_config.errors import ConfigurationError, RecordingError

_MALFORMED = (ValueError, KeyError, TypeError, IndexError, AttributeError, RecursionError)


def checkpoint_path(output: Path) -> Path:
    """Where the checkpoint of a result is."""
    return output.with_name(f"{output.name}.checkpoint")


def write_checkpoint(path: Path, key: Mapping[str, Any], progress: Progress) -> None:
    """Write a search's progress; `key` says of which search. Raises ClipError if it cannot."""
    nodes: list[Node] = []
    numbers: dict[int, int] = {}

    def number(node: Node) -> int:
        chain: list[Node] = []
        while id(node) not in numbers:
            chain.append(node)
            if node.parent is None:
                break
            node = node.parent
        for one in reversed(chain):
            numbers[id(one)] = len(nodes)
            nodes.append(one)
        return numbers[id(chain[0])] if chain else numbers[id(node)]

    levels = [[number(node) for node in level] for level in progress.levels]
    best = None if progress.best is None else number(progress.best)
    content = {
        "key": dict(key),
        "levels": levels,
        "best": best,
        "failures": progress.failures,
        "stuck": progress.stuck,
        "samples": progress.samples,
        "nodes": [
            [
                None if node.parent is None else numbers[id(node.parent)],
                node.cost,
                node.offset.tolist(),
                node.end.tolist(),
            ]
            for node in nodes
        ],
    }
    write_whole(path, json.dumps(content))


def read_feedbacks(path: Path) -> tuple[Gains, str]:
    """The feedback with which a checkpoint's search was made, and its window feedback.

    Raises:
        RecordingError: there is none, or it cannot be read.
    """
    try:
        key = json.loads(path.read_text(encoding="utf-8"))["key"]
        gains, by_window = key["feedback"], key["window_feedback"]
        if not isinstance(gains, dict) or not isinstance(by_window, str):
            raise TypeError
        return checked_gains(gains), by_window
    except OSError as error:
        raise RecordingError(f"cannot resume from {path}: {error.strerror or error}") from error
    except (*_MALFORMED, ConfigurationError) as error:
        raise RecordingError(f"{path}: not a checkpoint that can be resumed") from error


def read_checkpoint(path: Path, key: Mapping[str, Any]) -> Progress:
    """The progress that a checkpoint holds.

    Raises:
        RecordingError: there is none, or it cannot be read.
        ConfigurationError: it is of a search with other settings; says which differ.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        _check_key(path, content["key"], json.loads(json.dumps(dict(key))))
        nodes: list[Node] = []
        for parent, cost, offset, end in content["nodes"]:
            before = None if parent is None else nodes[parent]
            nodes.append(Node(before, np.array(offset), float(cost), np.array(end)))
        return Progress(
            levels=[[nodes[number] for number in level] for level in content["levels"]],
            failures=int(content["failures"]),
            stuck=int(content["stuck"]),
            best=None if content["best"] is None else nodes[content["best"]],
            samples=int(content["samples"]),
        )
    except OSError as error:
        raise RecordingError(f"cannot resume from {path}: {error.strerror or error}") from error
    except _MALFORMED as error:
        raise RecordingError(f"{path}: not a checkpoint that can be resumed") from error


def _check_key(path: Path, found: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
    differing = [name for name in wanted if found.get(name) != wanted[name]]
    if differing:
        name = differing[0]
        raise ConfigurationError(
            f"{path} is of a search whose {name} is {found.get(name)!r}, not {wanted[name]!r}; "
            "resume with the same settings, or --overwrite"
        )
