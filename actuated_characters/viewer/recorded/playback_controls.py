"""The controls of a time line in a panel: the time, playing, speed and loop."""

from collections.abc import Callable
from functools import partial
from typing import Any

import viser

from actuated_characters.viewer.controls.actions import ActionQueue
from actuated_characters.viewer.recorded.timeline import Playback

_SPEEDS = ("0.1", "0.25", "0.5", "1", "2", "4")
_PLAY, _PAUSE, _BACK, _NEXT, _START, _END = "Play", "Pause", "-1", "+1", "Start", "End"
_SHORTEST = 1e-3  # s: the least that the slider spans


class PlaybackControls:
    """The controls of all clients; the time line is moved in the thread that runs the actions."""

    def __init__(self, gui: viser.GuiApi, timeline: Playback, actions: ActionQueue) -> None:
        self._timeline, self._actions = timeline, actions
        first = float(timeline.times[0])
        end = max(timeline.end, first + _SHORTEST)
        self.slider: Any = gui.add_slider("Time (s)", first, end, 1e-3, initial_value=first)
        self._on(self.slider, self._seek)
        moves = (_PLAY, _PAUSE, _BACK, _NEXT, _START, _END)
        self.buttons: Any = gui.add_button_group("Playback", moves)
        self._on(self.buttons, self.move, click=True)
        speed: Any = gui.add_dropdown("Speed", _SPEEDS, initial_value="1")
        self._on(speed, lambda label: setattr(timeline, "speed", float(label)))
        loop: Any = gui.add_checkbox("Loop", initial_value=False)
        self._on(loop, partial(setattr, timeline, "loops"))

    def _on(self, handle: Any, act: Callable[[Any], None], *, click: bool = False) -> None:
        on(self._actions, handle, act, click=click)

    def _seek(self, time: float) -> None:
        self._timeline.plays = False
        self._timeline.seek_nearest(time)

    def move(self, button: str) -> None:
        """Do what a button says."""
        timeline = self._timeline
        if button == _PLAY:
            timeline.play()
        elif button == _PAUSE:
            timeline.plays = False
        elif button == _START:
            self._seek(float(timeline.times[0]))
        elif button == _END:
            self._seek(timeline.end)
        else:
            timeline.step(-1 if button == _BACK else 1)

    def show_time(self) -> None:
        """Have the slider at the present time, and as long as the time line."""
        end = max(self._timeline.end, float(self._timeline.times[0]) + _SHORTEST)
        if self.slider.max != end:
            self.slider.max = end
        self.slider.value = round(self._timeline.time, 3)


def on(
    actions: ActionQueue, handle: Any, act: Callable[[Any], None], *, click: bool = False
) -> None:
    """Have a function called with a control's value, as an action, when a client sets it."""

    async def change(event: viser.GuiEvent[Any]) -> None:
        if event.client_id is not None:  # an event without a client is this panel's own
            actions.put(partial(act, handle.value))

    (handle.on_click if click else handle.on_update)(change)
