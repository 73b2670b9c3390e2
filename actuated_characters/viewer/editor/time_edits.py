"""What pages do to keys and events on the time line: drags, choices, and the keyboard.

The script of the page (`time_edits.js`) says it as a text in a field that nobody sees, which is
checked as any other field of the panel is: a number that makes it another text than the one before,
the version of the document that the page has, what is done, and to what.
"""

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import viser

from actuated_characters.timeline.content import is_number
from actuated_characters.timeline.edits import rounded
from actuated_characters.viewer.controls.actions import ActionQueue
from actuated_characters.viewer.editor.chosen import Chosen
from actuated_characters.viewer.editor.items import Item, parse_item
from actuated_characters.viewer.editor.session import Session
from actuated_characters.viewer.recorded.playback_controls import on
from actuated_characters.viewer.recorded.time_bar import TimeBar
from msgs_config.errors import MotionError

STEP = 0.02
"""s between the times to which a drag goes."""

_LANE_HEIGHT = 13  # pixels of a row of events that last
_FILES = [Path(__file__).with_name(name) for name in ("time_edits.js", "time_edits.css")]


class TimeEdits:
    """Does to a session what pages ask for on the time line."""

    def __init__(
        self,
        gui: viser.GuiApi,
        bar: TimeBar,
        session: Session,
        chosen: Chosen,
        act: Callable[[Callable[[], object]], None],
        actions: ActionQueue,
    ) -> None:
        """`act` does something, and says what was wrong with it."""
        self._session, self._chosen = session, chosen
        self.count = 0
        """Another one after each thing that was asked for, also of one that was refused."""
        self._functions: dict[str, Callable[[], object]] = {
            "copy": chosen.copy,
            "paste": chosen.paste,
            "delete": chosen.delete,
            "undo": session.undo,
            "redo": session.redo,
        }
        self._drags: dict[object, Callable[[Item, float], object]] = {
            "move": chosen.move,
            "end": chosen.end,
        }
        field: Any = gui.add_text("Time line", "", visible=False)
        on(actions, field, lambda text: act(partial(self._do, text)))
        bar.add_files(_FILES)
        bar.tell(edits=field._impl.uuid, step=STEP, laneHeight=_LANE_HEIGHT)

    def _do(self, text: str) -> None:
        """Do what a text says. Raises MotionError if it cannot be done."""
        self.count += 1
        try:
            _, version, act, *values = json.loads(text)
        except (ValueError, TypeError, RecursionError) as error:
            raise MotionError("the time line was not understood") from error
        if not values:
            self._function(act)()
            return
        if version != self._session.version:
            raise MotionError("the time line has changed meanwhile; try it again")
        item = parse_item(str(values[0])) if values[0] else None
        if act == "choose":
            self._chosen.choose(item)
        elif act in self._drags and item is not None and is_number(at := values[-1]):
            self._drags[act](item, rounded(round(at / STEP) * STEP))
        else:
            raise MotionError("the time line was not understood")

    def _function(self, act: object) -> Callable[[], object]:
        if not isinstance(act, str) or act not in self._functions:
            raise MotionError("the time line was not understood")
        return self._functions[act]
