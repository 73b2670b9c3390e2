"""The parameters of recorded nodes, as they were in force one after another."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from actuated_characters.bags.rebuilding import Rebuilt, rebuild
from msgs_config.errors import RecordingError
from msgs_config.messages.configuration import SINCE, parse
from msgs_config.messages.session import ANONYMOUS

_CHANGED_AT_RESETS = ("parameters", "probe", SINCE)  # keys of a simulator's configuration


@dataclass(frozen=True)
class NodeParameters:
    """A node's parameters, and since when they are in force."""

    parameters: dict[str, Any]
    after_stamp_ns: int | None  # in force for states after that stamp; None: from the start
    files: Mapping[str, str] = field(
        default_factory=dict
    )  # SHA-256 of what was read, by the parameters' names


def in_force(settings: Sequence[NodeParameters], stamp_ns: int) -> dict[str, Any]:
    """The parameters of a state's stamp; none if there are none at all."""
    found: dict[str, Any] = {}
    for each in settings:
        if not found or each.after_stamp_ns is None or each.after_stamp_ns < stamp_ns:
            found = each.parameters
    return found


def between(
    settings: Sequence[NodeParameters], first_ns: int, last_ns: int
) -> tuple[NodeParameters, ...]:
    """Those that are in force in some of the states of these stamps."""
    found: list[NodeParameters] = []
    for each in settings:
        since_ns = -1 if each.after_stamp_ns is None else each.after_stamp_ns
        if since_ns < first_ns:
            found = []  # those before were replaced before the first of these states
        if since_ns < last_ns:
            found.append(each)
    return tuple(found)


class SimulatorConfigurations:
    """The configurations of one simulator, which says again what it is when a reset changes it."""

    def __init__(self, namespace: str) -> None:
        """`namespace` is that of its topics, without the leading slash."""
        self.rebuilt: Rebuilt | None = None
        self.parameters: list[NodeParameters] = []
        self._namespace = namespace
        self._texts: set[str] = set()
        self._unchanging: object = None

    def take(self, text: str) -> None:
        """Take a configuration's text; one that is known, as a latched one may be, counts once.

        Raises:
            RecordingError: it is of another simulator, or the character cannot be built.
            MessageError: the text is no configuration.
        """
        if text in self._texts:
            return
        known, content = parse(text), json.loads(text)
        unchanging = {key: content[key] for key in content if key not in _CHANGED_AT_RESETS}
        if self.rebuilt is None:
            self.rebuilt, self._unchanging = rebuild(text, self._namespace), unchanging
        elif known.session == ANONYMOUS or unchanging != self._unchanging:
            raise RecordingError("several simulators, or one restarted")
        self._texts.add(text)
        self.parameters.append(NodeParameters(known.parameters, content.get(SINCE)))

    def check_start(self, stamp_ns: int) -> None:
        """Raise RecordingError if it is not known what held at the first state's stamp."""
        after_ns = self.parameters[0].after_stamp_ns
        if after_ns is not None and after_ns >= stamp_ns:
            raise RecordingError(
                f"the simulator's parameters before {after_ns} ns are missing, its states are not"
            )
