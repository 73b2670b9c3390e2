"""The form of an event in the panel: other fields for each track."""

from collections.abc import Sequence
from typing import Any

import viser

from actuated_characters.timeline.edits import rounded
from actuated_characters.viewer.controls.actions import ActionQueue
from actuated_characters.viewer.editor.event_forms import FORMS, LINK, NUMBER, Field, read_form
from actuated_characters.viewer.editor.session import Session
from actuated_characters.viewer.recorded.playback_controls import on
from msgs_config.errors import MotionError

_LASTS, _SHORTEST = 1.0, 0.02  # s: at first, at least
_UNTIL, _LENGTH = "until", "lasts (s)"


class EventForm:
    """The fields of one track at a time, in the folder in which it is made."""

    def __init__(
        self, gui: viser.GuiApi, session: Session, tracks: Sequence[str], actions: ActionQueue
    ) -> None:
        self._gui, self._session = gui, session
        self._track: Any = gui.add_dropdown("New", tuple(tracks), initial_value=tracks[0])
        self._links = tuple(link.name for link in session.character.links)
        self._handles: dict[str, dict[str, Any]] = {
            track: {field.name: self._add(field) for field in FORMS[track]} for track in tracks
        }
        on(actions, self._track, self._show)
        self._show(tracks[0])

    def _add(self, field: Field) -> Any:
        label = f"{field.name}"
        if field.name == _UNTIL:  # said as a length: the present time may yet change
            hint = "s from the present time on"
            # 0 is where a number such as 0.5 begins to be typed
            return self._gui.add_number(_LENGTH, _LASTS, min=0.0, step=0.01, hint=hint)
        if field.kind == NUMBER:
            return self._gui.add_number(label, float(field.default), step=0.01, hint=field.about)
        if field.kind == LINK:
            first = field.default if field.default in self._links else self._links[0]
            return self._gui.add_dropdown(label, self._links, initial_value=first, hint=field.about)
        return self._gui.add_text(label, str(field.default), hint=field.about)

    def _show(self, track: str) -> None:
        for name, handles in self._handles.items():
            for handle in handles.values():
                handle.visible = name == track

    def event(self) -> tuple[str, dict[str, Any]]:
        """The track that is chosen, and what the fields say at the present time.

        Raises:
            MotionError: a field cannot be read.
        """
        track = str(self._track.value)
        given = {name: handle.value for name, handle in self._handles[track].items()}
        if _UNTIL in given:
            lasts = float(given[_UNTIL])
            if lasts < _SHORTEST:
                raise MotionError(f"{_LENGTH} is {lasts:g}; it must be {_SHORTEST:g} or more")
            given[_UNTIL] = rounded(self._session.time + lasts)
        return track, read_form(track, self._session.time, given)
