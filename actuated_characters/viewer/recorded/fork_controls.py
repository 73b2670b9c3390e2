"""The controls of forks: the folder of the panel, and what is offered beside an arrow."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Protocol

import viser

from actuated_characters.viewer.controls.actions import ActionQueue
from actuated_characters.viewer.controls.markup import as_text
from actuated_characters.viewer.recorded.push_arrow import DrawnPush

FORK_HERE, DISCARD, CANCEL = "Fork from here", "Discard", "Cancel"

_HINT = "To fork with a push, drag a part of the body."


class ForkTarget(Protocol):
    """What the controls act on; its methods are called in the player's own thread."""

    def fork(self, push: str, settings: Sequence[str]) -> None:
        """Fork the run at the present time."""

    def discard_push(self) -> None:
        """Remove the arrow."""


class ForkControls:
    """What all clients see of forks."""

    def __init__(
        self,
        gui: viser.GuiApi,
        actions: ActionQueue,
        target: ForkTarget,
        cancel: Callable[[], None],
    ) -> None:
        """`cancel` ends the fork that is being made; it is called in the server's thread."""
        self._gui, self._actions, self._target, self._cancel = gui, actions, target, cancel
        self._drawn = ""  # what the arrow says
        self._stands = self._is_let_go = False  # the arrow
        self._is_forking = False
        self._offered = gui.add_markdown("", visible=False)
        self._offer: Any = gui.add_button_group("This push", (FORK_HERE, DISCARD), visible=False)
        self._ending: Any = gui.add_button_group("Forking", (CANCEL,), visible=False)
        self._on_click(self._offer, self._take_offer)
        self._on_click(self._ending, lambda _: self._cancel())

    def _on_click(self, buttons: Any, act: Callable[[str], None]) -> None:
        """Call a function in the server's thread with the button on which a client has clicked."""

        async def click(event: viser.GuiEvent[Any]) -> None:
            if event.client_id is not None:
                act(str(buttons.value))

        buttons.on_click(click)

    def add_folder(self, *, by_arrow: bool) -> None:
        """Add the folder; `by_arrow`: arrows can be drawn."""
        gui = self._gui
        with gui.add_folder("Fork", expand_by_default=False):
            gui.add_markdown(_HINT, visible=by_arrow)
            self._push: Any = gui.add_text(
                "Push", "", hint="at this time: LINK:FX,FY,FZ in N, or nothing"
            )
            self._settings: Any = gui.add_text(
                "Set", "", hint="live parameters: NODE.NAME:=VALUE ..."
            )
            self._at_once: Any = gui.add_checkbox(
                "At once",
                initial_value=False,
                hint="fork as soon as an arrow is let go",
                visible=by_arrow,
            )
            buttons = gui.add_button_group("From here", ("Fork", CANCEL))
        self._on_click(buttons, lambda name: self._cancel() if name == CANCEL else self._fork())

        async def edit(event: viser.GuiEvent[Any]) -> None:
            if event.client_id is not None:  # the arrow does not stand for what was typed
                self._actions.put(self._target.discard_push)

        self._push.on_update(edit)

    def _take_offer(self, name: str) -> None:
        if name == DISCARD:
            self._actions.put(self._target.discard_push)
        else:
            self._fork()

    def _fork(self) -> None:
        push, settings = str(self._push.value).strip(), str(self._settings.value).split()
        self._actions.put(partial(self._target.fork, push, settings))

    def show_push(self, push: DrawnPush | None, duration: float, *, let_go: bool) -> None:
        """Have the folder say what an arrow says, and offer a fork once it is let go.

        None: there is no arrow any more. A push acts for a `duration` in s. While a fork is made
        none is offered, nor begun at once.
        """
        if push is not None:
            self._push.value = self._drawn = push.text
            text = f"push on {push.link}: {push.size:.0f} N for {duration:.3g} s"
            self._offered.content = as_text(text)
        elif self._push.value == self._drawn:  # and nothing else was typed
            self._push.value = ""
        self._stands = push is not None
        self._is_let_go = self._stands and let_go
        self._show_offers()
        if self._offer.visible and self._at_once.value:
            self._fork()

    def show_forking(self, *, goes_on: bool) -> None:
        """Offer to cancel a fork while it is being made, and no further one."""
        self._is_forking = goes_on
        self._show_offers()

    def _show_offers(self) -> None:
        """Show what can be done with the arrow, and with the fork that is being made."""
        self._offered.visible = self._stands
        self._offer.visible = self._is_let_go and not self._is_forking
        self._ending.visible = self._is_forking
