"""What a search has found so far, in a file beside its result, so that it can be resumed."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from actuated_characters.reconstruction.search import Progress
from actuated_characters.reconstruction.tree import Node
from controller_node.references.offsets import Offsets
from msgs_config.errors import ConfigurationError, RecordingError
from msgs_config.whole_files import write_whole

_ERRORS_OF_MALFORMED = (ValueError, KeyError, TypeError, IndexError, AttributeError, RecursionError)


def checkpoint_path(output: Path) -> Path:
    """Where the checkpoint of a result is."""
    return output.with_name(f"{output.name}.checkpoint")


def write_checkpoint(path: Path, key: Mapping[str, Any], progress: Progress) -> None:
    """Write a search's progress; `key` says of which. Raises RecordingError if it cannot."""
    numbers: dict[int, int] = {}
    rows: list[dict[str, Any]] = []
    ends = [node for level in progress.levels for node in level]
    for end in [*ends, *([] if progress.best is None else [progress.best])]:
        for node in end.path:
            if id(node) not in numbers:
                numbers[id(node)] = len(rows)
                rows.append(_row(node, None if node.parent is None else numbers[id(node.parent)]))
    content = {
        "key": dict(key),
        "nodes": rows,
        "levels": [[numbers[id(node)] for node in level] for level in progress.levels],
        "best": None if progress.best is None else numbers[id(progress.best)],
        "failures": progress.failures,
        "stuck": progress.stuck,
    }
    write_whole(path, json.dumps(content))


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
        for row in content["nodes"]:
            nodes.append(_node(row, None if row["parent"] is None else nodes[row["parent"]]))
        return Progress(
            levels=[[nodes[number] for number in level] for level in content["levels"]],
            failures=int(content["failures"]),
            stuck=int(content["stuck"]),
            best=None if content["best"] is None else nodes[content["best"]],
        )
    except OSError as error:
        raise RecordingError(f"cannot resume from {path}: {error.strerror or error}") from error
    except _ERRORS_OF_MALFORMED as error:
        raise RecordingError(f"{path}: not a checkpoint that can be resumed") from error


def _row(node: Node, parent: int | None) -> dict[str, Any]:
    plans = [
        [tick, offsets.knot_ticks, offsets.first_knot, offsets.rows.tolist()]
        for tick, offsets in node.plans
    ]
    return {
        "parent": parent,
        "tick": node.tick,
        "seed": node.seed,
        "plans": plans,
        "end": node.end.tolist(),
        "cost": node.cost,
        "ahead": node.ahead,
    }


def _node(row: Mapping[str, Any], parent: Node | None) -> Node:
    plans = [
        (int(tick), Offsets(int(knot_ticks), int(first), np.array(rows, dtype=float)))
        for tick, knot_ticks, first, rows in row["plans"]
    ]
    end = np.array(row["end"], dtype=float)
    numbers = float(row["cost"]), float(row["ahead"])
    motion = end[np.newaxis, : len(end) // 2]
    return Node(parent, int(row["tick"]), int(row["seed"]), tuple(plans), end, *numbers, motion)


def _check_key(path: Path, found: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
    differing = [name for name in wanted if found.get(name) != wanted[name]]
    if differing:
        name = differing[0]
        raise ConfigurationError(
            f"{path} is of a search whose {name} is {found.get(name)!r}, not {wanted[name]!r}; "
            "resume with the same settings, or --overwrite"
        )
