"""What is offered beside an arrow, and while a fork is made."""

from collections.abc import Iterator, Sequence

import pytest

from actuated_characters.viewer.controls.actions import ActionQueue
from actuated_characters.viewer.recorded.fork_controls import ForkControls
from actuated_characters.viewer.recorded.push_arrow import DrawnPush
from actuated_characters.viewer.web.request_check import RequestCheck
from actuated_characters.viewer.web.server import open_socket, start_server, stop_server

PUSH = DrawnPush("chest", (30, 40, 0))


class Forks:
    """Notes which forks are wanted."""

    def __init__(self) -> None:
        self.pushes: list[str] = []

    def fork(self, push: str, settings: Sequence[str]) -> None:
        del settings
        self.pushes.append(push)

    def discard_push(self) -> None:
        raise AssertionError


@pytest.fixture
def made() -> Iterator[tuple[ForkControls, ActionQueue, Forks]]:
    server = start_server(open_socket("127.0.0.1", 0), RequestCheck("127.0.0.1"), lambda _: None)
    actions, target = ActionQueue(), Forks()
    controls = ForkControls(server.gui, actions, target, lambda: None)
    controls.add_folder(by_arrow=True)
    yield controls, actions, target
    stop_server(server)


def seen(controls: ForkControls) -> tuple[bool, bool, bool]:
    """Whether there are what the arrow says, the offer of a fork, and that to cancel one."""
    handles = (controls._offered, controls._offer, controls._ending)
    return tuple(bool(each.visible) for each in handles)  # type: ignore[return-value]


def test_a_fork_is_offered_for_an_arrow_that_was_let_go_and_again_after_another_fork(
    made: tuple[ForkControls, ActionQueue, Forks],
) -> None:
    controls, _, _ = made
    assert seen(controls) == (False, False, False)
    controls.show_push(PUSH, 0.1, let_go=False)
    assert seen(controls) == (True, False, False)
    controls.show_push(PUSH, 0.1, let_go=True)
    assert seen(controls) == (True, True, False)
    controls.show_forking(goes_on=True)
    assert seen(controls) == (True, False, True)
    controls.show_forking(goes_on=False)  # it was cancelled, or has failed
    assert seen(controls) == (True, True, False)
    controls.show_push(None, 0.1, let_go=False)
    assert seen(controls) == (False, False, False)


def test_no_further_fork_is_offered_while_one_is_made(
    made: tuple[ForkControls, ActionQueue, Forks],
) -> None:
    controls, actions, target = made
    controls.show_forking(goes_on=True)
    controls._at_once.value = True

    controls.show_push(PUSH, 0.1, let_go=True)

    assert seen(controls) == (True, False, True)
    actions.run()
    assert target.pushes == []
    controls.show_forking(goes_on=False)
    assert seen(controls) == (True, True, False)
    controls.show_push(PUSH, 0.1, let_go=True)
    actions.run()
    assert target.pushes == ["chest:30,40,0"]
