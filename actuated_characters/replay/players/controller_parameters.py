"""The parameters of a recorded controller at its start, and the changes of both nodes'."""

import math
from collections.abc import Collection, Sequence
from contextlib import suppress
from typing import Any

from actuated_characters.bags.node_parameters import NodeParameters
from actuated_characters.bags.recording import Recording
from controller_node.files_read import files_read
from controller_node.ground import TERRAIN
from controller_node.parameters import resolve_for
from msgs_config.digests import sha256_of
from msgs_config.errors import RecordingError
from msgs_config.messages import topics
from sim_node.initial_state import INITIAL_STATE, POSITION, VELOCITY

_OF_A_CHARACTER = (POSITION, VELOCITY)  # of what a reset may change
_WITHOUT_LIMIT = "effort_limit."  # infinite ones are null in a configuration


def first_parameters(recording: Recording) -> dict[str, Any]:
    """The parameters of a recording's controller before its first answer.

    Raises:
        RecordingError: the bag does not have them.
    """
    return _known(_first(recording).parameters)


def changed_files(recording: Recording) -> list[str]:
    """A sentence for each file of a recording's controller that is not what it was.

    A file that is not there is left to who reads it; a terrain is taken from the recording.

    Raises:
        RecordingError: the bag does not have the controller's parameters.
    """
    settings = _first(recording)
    values = resolve_for(recording.character, _known(settings.parameters))
    sentences = []
    for name, path in files_read(recording.character, values).items():
        with suppress(OSError):
            if name != TERRAIN.name and settings.files.get(name, "") not in ("", sha256_of(path)):
                sentences.append(f"{path} is not the file that it was: its content differs")
    return sentences


def _first(recording: Recording) -> NodeParameters:
    if not recording.controller:
        raise RecordingError(
            "the recording has nothing on 'controller_node/configuration', so its controller "
            "cannot be started; start one yourself, and use --no-start"
        )
    first_ns = int(recording.stamps_ns[0])
    before = [
        settings
        for number, settings in enumerate(recording.controller)
        if number == 0 or settings.after_stamp_ns is None or settings.after_stamp_ns < first_ns
    ]
    return before[-1]


def parameter_changes(
    recording: Recording, fixed: Collection[str] = ()
) -> dict[int, list[dict[str, Any]]]:
    """The changes after the answer to each state, one after another, by its row.

    Parameters that are `fixed` are left out.
    """
    rows = {stamp: row for row, stamp in enumerate(recording.stamps_ns.tolist())}
    changes: dict[int, list[dict[str, Any]]] = {}
    before = _known(recording.controller[0].parameters) if recording.controller else {}
    for settings in recording.controller[1:]:
        now = _known(settings.parameters)
        changed = {name: now[name] for name in now if now[name] != before.get(name)}
        before = now
        row = rows.get(settings.after_stamp_ns or 0)
        changed = {name: value for name, value in changed.items() if name not in fixed}
        if row is not None and changed:
            changes.setdefault(row, []).append(changed)
    return changes


def reset_changes(together: Sequence[Recording]) -> dict[int, dict[str, Any]]:
    """The parameters of a world's simulator that count from an episode on, by its first row.

    Where the characters begin is given, also where it came from a controller.
    """
    changes: dict[int, dict[str, Any]] = {}
    for recording in together:
        prefix = f"{recording.world.name}." if recording.world.name else ""
        for row in recording.episode_rows.tolist()[1:]:
            before, now = recording.parameters_at(row - 1), recording.parameters_at(row)
            for name in now:
                if name != INITIAL_STATE and now[name] != before.get(name):
                    full_name = prefix + name if name in _OF_A_CHARACTER else name
                    changes.setdefault(row, {})[full_name] = now[name]
    return changes


def late_topics(recording: Recording) -> frozenset[str]:
    """The topics that the controller may subscribe to only in a later episode."""
    first = recording.controller[0].parameters if recording.controller else {}
    is_steered = first.get("reference") == "steered"
    return frozenset() if is_steered else frozenset({topics.CMD_VEL_STAMPED.name})


def _known(parameters: dict[str, Any]) -> dict[str, Any]:
    """Parameters as a node takes them."""
    return {
        name: math.inf if value is None and name.startswith(_WITHOUT_LIMIT) else value
        for name, value in parameters.items()
    }
