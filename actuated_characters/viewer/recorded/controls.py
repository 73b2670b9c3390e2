"""The panel of a recorded run: the time line, what is shown, exports and forks."""

from collections.abc import Sequence
from functools import partial
from typing import Any, Protocol

import viser

from actuated_characters.viewer.controls.actions import ActionQueue
from actuated_characters.viewer.controls.markup import as_text
from actuated_characters.viewer.drawing.scene import BrowserScene
from actuated_characters.viewer.parameters import SHOWN
from actuated_characters.viewer.recorded.fork_controls import CANCEL, ForkControls, ForkTarget
from actuated_characters.viewer.recorded.ghosts import NO_GHOST, REFERENCE
from actuated_characters.viewer.recorded.playback_controls import PlaybackControls, on
from actuated_characters.viewer.recorded.timeline import Playback

_PNG, _MP4 = "PNG", "MP4"
_OF_SCENE = {name: label for name, label in SHOWN.items() if name != "reference"}


class PanelTarget(ForkTarget, Protocol):
    """What the panel acts on; its methods are called in the player's own thread."""

    def save_picture(self, client: viser.ClientHandle) -> None:
        """Save what a client sees."""

    def save_film(self, client: viser.ClientHandle, start: float, end: float) -> None:
        """Save what a client sees from one time to another, s."""

    def cancel(self) -> None:
        """End the film or the fork that is being made."""


class RecordedPanel:
    """The panel of all clients."""

    def __init__(
        self,
        gui: viser.GuiApi,
        scene: BrowserScene,
        timeline: Playback,
        actions: ActionQueue,
        shown: PanelTarget,
        *,
        by_arrow: bool,
    ) -> None:
        """`by_arrow`: arrows can be drawn on the body, for forks."""
        self._gui, self._scene, self._timeline = gui, scene, timeline
        self._actions, self._shown = actions, shown
        self.shows = dict.fromkeys(SHOWN, True)
        self.is_cancelled = False
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        gui.set_panel_label("actuated characters")
        self._state = gui.add_markdown("")
        self.time = PlaybackControls(gui, timeline, actions)
        self.ghost: Any = gui.add_dropdown("Ghost", (REFERENCE, NO_GHOST))
        self.forks = ForkControls(gui, actions, shown, self._cancel)
        self.character: Any = gui.add_dropdown("Plots of", ("",), visible=False)
        self._told = gui.add_markdown("", visible=False)
        self._progress: Any = gui.add_progress_bar(0.0, visible=False)
        self._add_shown()
        self._add_export()
        self.forks.add_folder(by_arrow=by_arrow)

    def _add_shown(self) -> None:
        with self._gui.add_folder("Show", expand_by_default=False):
            for name, label in _OF_SCENE.items():
                box: Any = self._gui.add_checkbox(label, initial_value=True)
                on(self._actions, box, partial(self.shows.__setitem__, name))
            follows: Any = self._gui.add_checkbox("Follow", initial_value=True)
            on(self._actions, follows, partial(setattr, self._scene, "follows"))

    def _add_export(self) -> None:
        gui, timeline = self._gui, self._timeline
        with gui.add_folder("Export", expand_by_default=False):
            start = gui.add_number("From (s)", float(timeline.times[0]), min=0.0, step=0.1)
            end = gui.add_number("To (s)", timeline.end, min=0.0, step=0.1)
            buttons = gui.add_button_group("What is seen", (_PNG, _MP4, CANCEL))

        async def export(event: viser.GuiEvent[Any]) -> None:
            if event.client is None:
                return
            if buttons.value == _PNG:
                self._actions.put(partial(self._shown.save_picture, event.client))
            elif buttons.value == _MP4:
                times = float(start.value), float(end.value)
                self._actions.put(partial(self._shown.save_film, event.client, *times))
            else:
                self._cancel()

        buttons.on_click(export)

    def _cancel(self) -> None:
        """Called in the server's thread: the player's may be busy with a film."""
        self.is_cancelled = True
        self._actions.put(self._shown.cancel)

    def choose_ghosts(self, names: Sequence[str], chosen: str) -> None:
        """Offer these ghosts beside the reference."""
        self.ghost.options = (REFERENCE, *names, NO_GHOST)
        self.ghost.value = chosen

    def show_time(self, title: str) -> None:
        """Show where the time line is."""
        timeline = self._timeline
        text = (
            f"**{as_text(title)}**  \n{timeline.time:.3f} s, state {timeline.row} of "
            f"{len(timeline.times) - 1}"
        )
        if self._state.content != text:
            self._state.content = text
            self.time.show_time()

    def tell(self, sentence: str) -> None:
        """Show a sentence as it is; none if it is empty."""
        self._told.content = as_text(sentence)
        self._told.visible = bool(sentence)

    def show_progress(self, share: float | None) -> None:
        """Show how far something is, 0 to 1; None: nothing is being done."""
        self._progress.visible = share is not None
        self._progress.value = 100.0 * (share or 0.0)
