"""The panel of a search: which window is shown, what has become of its worlds, the colours."""

from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any

import viser

from actuated_characters.viewer.controls.actions import ActionQueue
from actuated_characters.viewer.controls.markup import as_text
from actuated_characters.viewer.drawing.colors import GHOST
from actuated_characters.viewer.drawing.scene import BrowserScene
from actuated_characters.viewer.search.news import Fate, MotionNews, WindowNews, as_cost

EARLIER, LATER, NEWEST = "Earlier", "Later", "Newest"
_ABOUT = (
    "**Sampling** (SAMCON): in each window all worlds go on from the states that were kept, each "
    "with other samples. The best are kept, and the next window goes on from these. Behind are the "
    "worlds of a window, four times slower than real time, with their costs; before them is the "
    "best path so far, in real time."
)
_MEANINGS = {
    Fate.BEST: "the best of those that are kept",
    Fate.KEPT: "is kept, too",
    Fate.DROPPED: "costs more, and is not kept",
    Fate.LOST: "fell, or went too far from the motion",
}


class SearchPanel:
    """The panel of all clients."""

    def __init__(
        self,
        gui: viser.GuiApi,
        scene: BrowserScene,
        title: str,
        about: str,
        actions: ActionQueue,
        move: Callable[[str], None],
    ) -> None:
        """`move` is called, among `actions`, with EARLIER, LATER or NEWEST."""
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        gui.set_panel_label("actuated characters")
        self._title = as_text(title)
        self._state = gui.add_markdown(f"**{self._title}**")
        gui.add_markdown(about or _ABOUT)
        self._told = gui.add_markdown("")
        self.moves: Any = gui.add_button_group("Window", (EARLIER, LATER, NEWEST))
        gui.add_html(_legend())
        follows: Any = gui.add_checkbox("Follow", initial_value=True)

        async def click(event: viser.GuiEvent[Any]) -> None:
            if event.client_id is not None:
                actions.put(partial(move, self.moves.value))

        async def follow(event: viser.GuiEvent[Any]) -> None:
            if event.client_id is not None:
                actions.put(partial(setattr, scene, "follows", follows.value))

        self.moves.on_click(click)
        follows.on_update(follow)

    @property
    def text(self) -> str:
        """What it says of what is shown."""
        return f"{self._state.content}\n\n{self._told.content}"

    def show_window(self, window: WindowNews, newest: int) -> None:
        """Say what a window is, of so many that were tried."""
        self._state.content = f"**{self._title}**, up to {window.time:.2f} s"
        counts = Counter(world.fate for world in window.worlds)
        kept, lost = counts[Fate.BEST] + counts[Fate.KEPT], counts[Fate.LOST]
        count = len(window.worlds) + window.hidden
        sentences = [
            f"**Window {window.number} of {window.windows}**: {count} worlds, {kept} kept, "
            f"{lost} lost."
        ]
        if not kept:
            sentences.append("**All are lost**: the search goes back to an earlier window.")
        if costs := sorted(each.cost for each in window.worlds if each.cost is not None):
            sentences.append(f"Costs {as_cost(costs[0])} to {as_cost(costs[-1])}.")
        sentences.append(
            f"So far all were lost {_times(window.failures)}."
            if window.failures
            else "So far in no window all were lost."
        )
        if window.hidden:
            sentences.append(f"{window.hidden} more worlds, which are not kept, are not shown.")
        if newest > 0:
            ones = "one" if newest == 1 else "ones"
            sentences.append(f"{newest} later {ones}: *{LATER}*, *{NEWEST}*.")
        self._told.content = " ".join(sentences)

    def show_motion(self, motion: MotionNews, seconds: float, earlier: int) -> None:
        """Say what a motion of so many s is, before which so many windows can be seen."""
        self._state.content = f"**{self._title}**, {seconds:.2f} s"
        again = f" *{EARLIER}* shows the windows again." if earlier else ""
        self._told.content = f"**{as_text(motion.word)}**: {as_text(motion.about)}{again}"


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _legend() -> str:
    """What the colours mean."""
    rows = [(fate.color, fate.word, _MEANINGS[fate]) for fate in Fate]
    rows.append((GHOST, "outline", "the captured motion"))
    lines = [
        f'<div><span style="color: rgb{color}; font-size: 1.5em">&#9632;</span> <b>{word}</b>: '
        f"{meaning}</div>"
        for color, word, meaning in rows
    ]
    return f'<div style="font-size: 0.85em; padding: 0 0.6em">{"".join(lines)}</div>'
