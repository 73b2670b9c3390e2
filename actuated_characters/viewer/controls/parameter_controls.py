"""Controls of parameters of a character's nodes, of those that the nodes have."""

import math
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from typing import Any

import viser

from actuated_characters.viewer.controls.requests import Requests
from actuated_characters.viewer.controls.shown_parameters import (
    SIMULATOR,
    TO_TRY,
    ShownParameter,
)

Later = Callable[[Callable[..., None], Callable[[], Any]], Callable[..., Any]]


class ParameterControls:
    """Folders of controls, each of one parameter; hidden where the node has none."""

    def __init__(
        self,
        gui: viser.GuiApi,
        requests: Requests,
        later: Later,
        tell: Callable[[str], None],
        order: float | None = None,
        rest: AbstractContextManager[object] | None = None,
    ) -> None:
        """`order` is where a scene's own folder stands on the panel; others stand at its end.

        They stand in `rest`, closed, if that is a folder.
        """
        self._order, self._rest = order, rest or nullcontext()
        self._gui, self._requests, self._later, self._tell = gui, requests, later, tell
        self._nodes: dict[str, str] = {}  # whole names of nodes by those in the contract
        self._prefix = ""  # begins the names of the character's own parameters of its simulator
        self._shown: Mapping[str, tuple[ShownParameter, ...]] = {}
        self._folders: dict[str, Any] = {}
        self._controls: dict[tuple[str, str], tuple[ShownParameter, Any]] = {}
        """By the node whose value is shown, and the parameter's name."""
        self._whole: set[tuple[str, str]] = set()  # those of them that are whole numbers

    def choose(
        self, nodes: dict[str, str], name: str, shown: Mapping[str, tuple[ShownParameter, ...]]
    ) -> None:
        """Be about some nodes from now on, and about the parameters of each folder's title.

        `name` is the character's in its simulator; empty where it is alone.
        """
        self._nodes, self._prefix = nodes, f"{name}." if name else ""
        if shown != self._shown:
            self._shown = shown
            self._build()
        for _, handle in self._controls.values():
            handle.visible = False  # the node has yet to say that it has the parameter
        for folder in self._folders.values():
            folder.visible = False
        self._ask(self._controls)

    def _build(self) -> None:
        for folder in self._folders.values():
            folder.remove()
        self._folders, self._controls, self._whole = {}, {}, set()
        for title, parameters in self._shown.items():
            folder = self._add_folder(title)
            self._folders[title] = folder
            with folder:
                for shown in parameters:
                    handle = self._add(shown)
                    handle.on_update(
                        self._later(partial(self._set, shown), partial(getattr, handle, "value"))
                    )
                    self._controls[shown.key] = shown, handle

    def _add_folder(self, title: str) -> Any:
        if title == TO_TRY:
            return self._gui.add_folder(title, visible=False, order=self._order)
        is_open = not self._folders and isinstance(self._rest, nullcontext)
        with self._rest:
            return self._gui.add_folder(title, visible=False, expand_by_default=is_open)

    def _add(self, shown: ShownParameter) -> Any:
        if shown.options:
            return self._gui.add_dropdown(shown.label, shown.options, visible=False)
        if shown.range is None:
            return self._gui.add_checkbox(shown.label, initial_value=False, visible=False)
        return self._gui.add_slider(
            shown.label, *shown.range, initial_value=shown.range[0], visible=False
        )

    def _ask(self, keys: Iterable[tuple[str, str]]) -> None:
        """Ask the nodes for the values in force of parameters."""
        for node, whole in self._nodes.items():
            own = [name for of, name in keys if of == node]
            if own:
                self._requests.get(whole, own, partial(self._take, node))

    def _take(self, node: str, values: dict[str, object]) -> None:
        """Show the values of the parameters that a node has."""
        for name, value in values.items():
            shown, handle = self._controls.get((node, name), (None, None))
            if shown is not None:
                self._show(shown, handle, value)
        for title, parameters in self._shown.items():
            self._folders[title].visible = any(
                self._controls[shown.key][1].visible for shown in parameters
            )

    def _show(self, shown: ShownParameter, handle: Any, value: Any) -> None:
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if shown.range is not None and not is_number:
            self._tell(f"{shown.name} is {value}, which no slider can show")
            return
        if isinstance(value, int) and is_number:
            self._whole.add(shown.key)
        handle.visible = True
        if shown.options and value not in handle.options:
            handle.options = (*shown.options, value)
        if shown.range is not None:
            value = min(max(value, shown.range[0]), shown.range[1])
        if handle.value != value:
            handle.value = value

    def _set(self, shown: ShownParameter, value: Any) -> None:
        if shown.has_no_limit and shown.range is not None and value >= shown.range[1]:
            value = math.inf
        elif shown.key in self._whole:
            value = round(value)
        for node in shown.nodes:
            told = partial(self._told, shown, value, node)
            self._requests.set(self._nodes[node], shown.name, value, told)

    def _told(self, shown: ShownParameter, value: object, node: str, reason: str) -> None:
        """Say what a node has said; where it has rejected a value, show the one in force."""
        given = f"{value:g}" if isinstance(value, float) else str(value)
        self._tell(
            f"{shown.name} {given}: {reason or ('at the next reset' if shown.at_reset else 'set')}"
        )
        if reason:
            self._ask([shown.key])
            return
        for other, name, follows in shown.then:
            whole = self._prefix + name if other == SIMULATOR else name
            self._requests.set(self._nodes[other], whole, follows, partial(self._reject, whole))

    def _reject(self, name: str, reason: str) -> None:
        if reason:
            self._tell(f"{name}: {reason}")
