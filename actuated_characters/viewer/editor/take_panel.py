"""The folder of the panel for takes: simulate, choose one, compare it with another."""

import time
from collections.abc import Callable, Mapping
from typing import Any

import viser

from actuated_characters.timeline import edits
from actuated_characters.timeline.content import Content
from actuated_characters.viewer.controls.actions import ActionQueue
from actuated_characters.viewer.editor.session import Session
from actuated_characters.viewer.editor.shown_takes import NO_TAKE, ShownTakes
from actuated_characters.viewer.recorded.playback_controls import on

_SIMULATE, _CANCEL = "Simulate", "Cancel"
_WANTED = "what is wanted"
_TRACKS, _BEHAVIOURS = "tracking", ("tracking", "active_ragdoll", "reactive", "ragdoll")
_BEHAVIOUR, _RUN = "behaviour", "run"
_TYPING = 0.8  # s without another digit, after which a number is taken as typed
_HINT = "tracking: holds the motion; active_ragdoll: falls when hit hard, and gets up"


class TakePanel:
    """What all clients see of takes."""

    def __init__(
        self,
        gui: viser.GuiApi,
        session: Session,
        takes: ShownTakes,
        act: Callable[[Callable[[], object]], None],
        tell: Callable[[str], None],
        actions: ActionQueue,
    ) -> None:
        """`act` does something, and says what was wrong with it; `tell` says a sentence."""
        self._session, self._takes, self._act, self._tell = session, takes, act, tell
        self._shown = -1
        self._typed: tuple[float, float] | None = None  # a length in s, and when it was typed
        with gui.add_folder("Takes"):
            self._behaviour: Any = gui.add_dropdown("Behaviour", _BEHAVIOURS, hint=_HINT)
            on(actions, self._behaviour, lambda name: act(lambda: self._set_behaviour(name)))
            self._length: Any = gui.add_number(
                "Duration (s)", 0.0, min=0.0, step=0.1, hint="0: until 1 s after what is last"
            )
            on(actions, self._length, self._type_duration)
            self._title: Any = gui.add_text("Title", "", hint="what is said of the next take")
            buttons = gui.add_button_group("Take", (_SIMULATE, _CANCEL))
            on(actions, buttons, lambda name: act(self._functions[name]), click=True)
            self._take: Any = gui.add_dropdown("Seen", (NO_TAKE,))
            on(actions, self._take, lambda label: act(lambda: takes.choose(label)))
            self._other: Any = gui.add_dropdown("Outline", (_WANTED,))
            on(actions, self._other, lambda label: act(lambda: takes.compare(label)))
        self._functions = {_SIMULATE: self._simulate, _CANCEL: takes.cancel}
        self.show()

    def show_settings(self, content: Content) -> None:
        """Show what of `run` of a file is set here."""
        behaviour = str(_settings(content).get(_BEHAVIOUR, _TRACKS))
        others = () if behaviour in _BEHAVIOURS else (behaviour,)
        self._behaviour.options = (*_BEHAVIOURS, *others)
        self._behaviour.value = behaviour
        self._length.value = float(content.get("duration") or 0.0)

    def _type_duration(self, seconds: float) -> None:
        self._typed = float(seconds), time.monotonic()

    def _set_duration(self, patience: float = 0.0) -> None:
        """Have what was typed, once so many s have passed: 12 begins as 1."""
        if self._typed is not None and time.monotonic() - self._typed[1] >= patience:
            seconds, self._typed = self._typed[0], None
            self._session.edit(edits.set_value("duration", seconds or None))

    def _set_behaviour(self, name: str) -> None:
        settings = _settings(self._session.document.content)
        if name != settings.get(_BEHAVIOUR, _TRACKS):
            self._session.edit(edits.set_value(_RUN, {**settings, _BEHAVIOUR: name}))

    def _simulate(self) -> None:
        self._set_duration()
        self._takes.simulate(str(self._title.value).strip())
        self._title.value = ""

    def show(self) -> None:
        """Show what there is, and say what has come of the take that was made."""
        if self._typed is not None:
            self._act(lambda: self._set_duration(_TYPING))
        said = self._takes.advance()
        if said:
            self._tell(said)
        seconds = self._takes.making
        if seconds is not None:
            self._tell(f"{self._takes.simulated or 'preparing'}, for {seconds:.0f} s")
        if self._shown == self._takes.version:
            return
        self._shown = self._takes.version
        labels = tuple(self._takes.names)
        self._take.options = (NO_TAKE, *labels)
        self._take.value = self._takes.chosen
        other = self._other.value
        self._other.options = (_WANTED, *labels)
        self._other.value = other if other in self._other.options else _WANTED


def _settings(content: Content) -> Mapping[str, Any]:
    """What a file has under `run`, where it is a mapping."""
    found = content.get(_RUN)
    return found if isinstance(found, dict) else {}
