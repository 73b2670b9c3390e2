"""What all nodes have in common that play a recording: they wait for others, set, and call."""

import time
from collections.abc import Callable, Mapping
from typing import Any

from msgs_config.bus.composition import UNTIL_A_MESSAGE, ComposableNode, Turns
from msgs_config.bus.node import Answer, BusNode, Client, Executor, Publisher, StopFlag
from msgs_config.errors import RefusedError, RunError

ANSWER_TIMEOUT = 60.0
"""s that an answer may take, on a machine that may be busy with other things."""

WAITING, STATE = "waiting for ", "state "  # begin the lines that a player prints
_ACKNOWLEDGE_TIMEOUT = 10.0  # s until a node has what it was sent
_WAITING_PERIOD = 2.0  # s between lines about one thing that is waited for
_STATE_PERIOD = 0.1  # s between lines about the number of states


class Player(ComposableNode):
    """A node that plays; it prints how far it is, and what it waits for, unless it is `silent`."""

    stop: StopFlag
    executor: Executor

    def __init__(self, node: BusNode, *, silent: bool = False) -> None:
        """Play at this place on a bus."""
        super().__init__(node)
        self._is_silent, self._next_state = silent, 0.0

    def turns(self, stop: StopFlag, executor: Executor) -> Turns:
        """Play to the end, or until `stop`. Raises what `play` raises."""
        self.stop, self.executor = stop, executor
        yield from self.play()

    def play(self) -> Turns:
        """Play to the end, or until `stop`."""
        raise NotImplementedError

    def look(self) -> None:
        """Take what has come, before what is waited for is looked at."""

    def wait(
        self,
        condition: Callable[[], object],
        what: Callable[[], str],
        timeout: float = ANSWER_TIMEOUT,
    ) -> Turns:
        """Wait until a condition holds, or until this node is to stop; a timeout may be infinite.

        Raises:
            RunError: it has taken longer than the timeout in s.
        """
        begun = time.monotonic()
        next_line = begun + _WAITING_PERIOD
        while not self.stop and not self._holds(condition):
            yield UNTIL_A_MESSAGE
            now = time.monotonic()
            # the turn of another node may have taken that long
            if now > begun + timeout and not self._holds(condition):
                raise RunError(f"waited {timeout:g} s for {what()}")
            if now > next_line and not self._is_silent:
                next_line = now + _WAITING_PERIOD
                print(f"{WAITING}{what()}", flush=True)

    def _holds(self, condition: Callable[[], object]) -> bool:
        self.look()
        return bool(condition())

    def tell_state(self, count: int) -> None:
        """Print the number of states so far, ten times a second at the most."""
        now = time.monotonic()
        if now > self._next_state and not self._is_silent:
            self._next_state = now + _STATE_PERIOD
            print(f"{STATE}{count}", flush=True)

    def set_parameters(self, client: Client, node: str, settings: Mapping[str, Any]) -> Turns:
        """Set parameters of a node.

        Raises:
            RefusedError: it rejects one.
            RunError: it does not answer.
        """
        names = some_of(list(settings))
        answer = client.set_parameters(settings)
        yield from self.wait(lambda: answer.is_given, lambda: f"{node} to accept {names}")
        _check(answer, f"{node} rejected {names}")

    def call(
        self, client: Client, node: str, service: str, *, flag: bool = True, timeout: float
    ) -> Turns:
        """Call a service of a node.

        Raises:
            RefusedError: it does not do it.
            RunError: it does not answer.
        """
        answer = client.call(service, flag)
        yield from self.wait(lambda: answer.is_given, lambda: f"{node} to {service}", timeout)
        _check(answer, f"{node} did not {service}")

    @staticmethod
    def acknowledge(publisher: Publisher, what: str) -> None:
        """Wait until all subscribers have what was published. Raises RunError if one has not."""
        if not publisher.is_acknowledged(_ACKNOWLEDGE_TIMEOUT):
            raise RunError(f"{what} was not acknowledged")


def _check(answer: Answer, failure: str) -> None:
    """Raise RefusedError if an answer, given before this node was to stop, is a refusal."""
    if answer.is_given and not answer.success:
        raise RefusedError(f"{failure}: {answer.message}")


def some_of(names: list[str]) -> str:
    """At most three names, and the number of the others."""
    shown = ", ".join(f"'{name}'" for name in names[:3])
    return f"{shown} and {len(names) - 3} more" if len(names) > 3 else shown
