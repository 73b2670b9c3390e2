"""Controls of a few of a controller's parameters, of those that it has."""

from collections.abc import Callable
from functools import partial
from typing import Any

import viser

from actuated_characters.viewer.controls.requests import Requests
from controller_node.control_laws import LAWS

_LAW, _BALANCE = "law", "balance.enabled"
_SLIDERS = {  # label, least, most, step
    "gain_scale.p": ("Stiffness ×", 0.0, 3.0, 0.05),
    "gain_scale.d": ("Damping ×", 0.0, 3.0, 0.05),
    "balance.stiffness": ("Balance (N/m)", 0.0, 5000.0, 50.0),
    "balance.damping": ("Balance (N s/m)", 0.0, 1000.0, 10.0),
}

Later = Callable[[Callable[..., None], Callable[[], Any]], Callable[..., Any]]


class ParameterControls:
    """A folder of controls, each of one live parameter; hidden where the node has none."""

    def __init__(
        self, gui: viser.GuiApi, requests: Requests, later: Later, tell: Callable[[str], None]
    ) -> None:
        self._requests, self._tell = requests, tell
        self._node = ""
        self._handles: dict[str, Any] = {}
        self._folder = gui.add_folder("Controller", visible=False)
        with self._folder:
            self._handles[_LAW] = gui.add_dropdown("Law", tuple(LAWS))
            for name, (label, least, most, step) in _SLIDERS.items():
                if name == "balance.stiffness":
                    self._handles[_BALANCE] = gui.add_checkbox("Balance", initial_value=False)
                self._handles[name] = gui.add_slider(label, least, most, step, initial_value=least)
        for name, handle in self._handles.items():
            handle.on_update(later(partial(self._set, name), partial(getattr, handle, "value")))

    def choose(self, node: str) -> None:
        """Be about a controller's node from now on."""
        self._node = node
        self._requests.get(node, list(self._handles), self._take)

    def _take(self, values: dict[str, object]) -> None:
        """Show the values of the parameters that the node has."""
        self._folder.visible = bool(values)
        for name, handle in self._handles.items():
            handle.visible = name in values
            if name in values and handle.value != values[name]:
                handle.value = values[name]

    def _set(self, name: str, value: object) -> None:
        self._requests.set(self._node, name, value, partial(self._told, name, value))

    def _told(self, name: str, value: object, reason: str) -> None:
        """Say what the node has said; where it has rejected a value, show the one in force."""
        shown = f"{value:g}" if isinstance(value, float) else str(value)
        self._tell(f"{name} {shown}: {reason or 'set'}")
        if reason:
            self._requests.get(self._node, list(self._handles), self._take)
