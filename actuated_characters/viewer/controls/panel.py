"""The panel beside the scene: the run, what is shown, touch, and the controller's parameters."""

import time
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import viser
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from actuated_characters.viewer.controls.actions import ActionQueue
from actuated_characters.viewer.controls.drive import DrivingControls
from actuated_characters.viewer.controls.hands import Hands
from actuated_characters.viewer.controls.legend import legend
from actuated_characters.viewer.controls.live_curves import ShownCurves
from actuated_characters.viewer.controls.markup import as_text
from actuated_characters.viewer.controls.pace import Pace
from actuated_characters.viewer.controls.parameter_controls import ParameterControls
from actuated_characters.viewer.controls.requests import Requests
from actuated_characters.viewer.controls.shown_parameters import (
    CONTROLLER,
    SIMULATOR,
    ShownParameter,
)
from actuated_characters.viewer.drawing.live_character import LiveCharacter
from actuated_characters.viewer.drawing.sample import CharacterSample
from actuated_characters.viewer.drawing.scene import BrowserScene
from actuated_characters.viewer.parameters import SHOWN, TOUCH, ViewerSettings
from msgs_config.messages import topics

_SPEEDS = {"as fast as it can": 0.0, "0.1": 0.1, "0.25": 0.25, "0.5": 0.5, "1": 1.0, "2": 2.0}
_PAUSE, _RESUME, _STEP, _RESET = "Pause", "Resume", "Step", "Reset"
_HELP = (
    "Drag a body to pull it. Shift and click throws a ball at it. Drag the background to look "
    "around; the wheel zooms."
)
_TEXT_PERIOD = 0.2  # s between texts: the page lays each out
_NAME_OF_ONLY_CHARACTER = "alone"  # the character of a simulator that has one, without a name


@dataclass(frozen=True)
class Subject:
    """A character that the panel can be about."""

    character: str
    simulator: str  # its namespace, which begins with `/` or is empty
    below: str  # the character's own namespace, of the same form
    session: str
    parameters: Mapping[str, tuple[ShownParameter, ...]] = field(
        default_factory=dict, compare=False
    )
    """That the panel has of its nodes, by the titles of folders."""


class ControlPanel:
    """The panel of all clients, about one character of those that there are."""

    def __init__(
        self,
        node: Node,
        gui: viser.GuiApi,
        scene: BrowserScene,
        hands: Hands,
        actions: ActionQueue,
        settings: ViewerSettings,
    ) -> None:
        self._gui, self._scene, self._hands, self._actions = gui, scene, hands, actions
        self.requests = Requests(node)
        self.shows = {name: name not in settings.hidden for name in SHOWN}
        self._subject = Subject("", "", "", "")
        self._characters: Mapping[str, LiveCharacter] = {}
        self._next_text = 0.0
        self._names: tuple[str, ...] = ()
        self._is_chosen = False  # whether a page has chosen the character
        self._pace = Pace()
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        gui.set_panel_label("actuated characters")
        if settings.about:
            gui.add_markdown(settings.about)
        self._state = gui.add_markdown("no simulator")
        self._which: Any = gui.add_dropdown("Character", (_NAME_OF_ONLY_CHARACTER,), visible=False)
        self._which.on_update(self._later(self._choose, lambda: True))
        self._add_run()
        gui.add_markdown(_HELP)
        self._legend = gui.add_html("")
        self._told = gui.add_markdown("", visible=False)
        self._curves = ShownCurves(gui, self.requests, settings.curves)
        order = self._told.order + 0.5  # of the controls that a scene has first
        self._drive = DrivingControls(node, gui, actions)
        self._add_touch(opened=TOUCH in settings.opened)
        # what a page is for comes first, if it says so
        rest = gui.add_folder("More", expand_by_default=False) if settings.about else nullcontext()
        with rest:
            self._add_shown()
        self._controls = ParameterControls(gui, self.requests, self._later, self.tell, order, rest)

    def _later(self, function: Callable[..., None], value: Callable[[], Any]) -> Callable[..., Any]:
        """A callback of viser that has the node's thread call a function with a value."""

        async def change(event: viser.GuiEvent[Any]) -> None:
            if event.client_id is not None:  # an event without a client is this panel's own
                self._actions.put(partial(function, value()))

        return change

    def _choose(self, is_chosen: bool) -> None:
        self._is_chosen = is_chosen

    def _add_run(self) -> None:
        buttons = self._gui.add_button_group("Run", (_PAUSE, _RESUME, _STEP, _RESET))
        buttons.on_click(self._later(self._control, lambda: buttons.value))
        self._speed: Any = self._gui.add_dropdown(
            "Speed", tuple(_SPEEDS), initial_value="1", hint="simulated time over wall time"
        )
        self._speed.on_update(self._later(self._set_speed, lambda: self._speed.value))

    def _add_touch(self, *, opened: bool) -> None:
        gui, hands = self._gui, self._hands
        with gui.add_folder("Touch", expand_by_default=opened):
            for label, name, limits in (
                ("Spring (N/m)", "stiffness", (50.0, 3000.0, 50.0)),
                ("Ball (kg)", "ball_mass", (0.1, 20.0, 0.1)),
                ("Ball (m/s)", "ball_speed", (1.0, 30.0, 0.5)),
            ):
                slider = gui.add_slider(label, *limits, initial_value=float(getattr(hands, name)))
                slider.on_update(self._later(partial(setattr, hands, name), _value_of(slider)))
            pour = gui.add_button("Pour balls", hint="twenty of the mass above, over the character")
            pour.on_click(self._later(self._pour, lambda: self._subject.below))

    def _pour(self, below: str) -> None:
        character = self._characters.get(below)
        if character is not None:
            self.tell(self._hands.pour(character))

    def _add_shown(self) -> None:
        gui = self._gui
        with gui.add_folder("Show", expand_by_default=False):
            for name, label in SHOWN.items():
                box = gui.add_checkbox(label, initial_value=self.shows[name])
                box.on_update(self._later(partial(self._show, name), _value_of(box)))
            follows = gui.add_checkbox("Follow", initial_value=True)
            follows.on_update(
                self._later(partial(setattr, self._scene, "follows"), _value_of(follows))
            )

    def _show(self, name: str, is_shown: bool) -> None:
        self.shows[name] = is_shown

    def update(self, known: Mapping[str, Subject], stamps_ns: Mapping[str, int]) -> None:
        """Be about the chosen one of the characters that are known now, by their namespaces.

        Shows the time of its newest state, and hands out what nodes have responded.
        """
        self.requests.poll()
        names = tuple(below.lstrip("/") or _NAME_OF_ONLY_CHARACTER for below in known)
        if names and names != self._names:
            self._names = names
            self._which.options = names
            if not self._is_chosen and self._which.value != names[0]:
                self._which.value = names[0]
            self._which.visible = len(names) > 1
        chosen = dict(zip(names, known.values(), strict=True)).get(self._which.value)
        self._drive.update(None if chosen is None else chosen.below)
        if chosen is None:
            return
        if chosen != self._subject:
            self._subject = chosen
            node = f"{chosen.simulator}/{topics.SIM_NODE}"
            self.requests.get(node, ["real_time_factor", "wrench_duration"], self._take_settings)
            controller = f"{chosen.below}/{topics.CONTROLLER_NODE}"
            own = chosen.below.removeprefix(chosen.simulator).strip("/")
            nodes = {SIMULATOR: node, CONTROLLER: controller}
            self._controls.choose(nodes, own, chosen.parameters)
        stamp_ns, now = stamps_ns.get(chosen.below), time.monotonic()
        if stamp_ns is not None and now >= self._next_text:
            self._next_text = now + _TEXT_PERIOD
            pace = self._pace.measure(chosen.below, 1e-9 * stamp_ns, now)
            text = f"**{as_text(chosen.character)}**, {pace}{1e-9 * stamp_ns:.2f} s"
            if self._state.content != text:
                self._state.content = text
            self._show_legend(chosen.below)

    def _show_legend(self, below: str) -> None:
        character = self._characters.get(below)
        text = legend(
            self.shows,
            has_sides=character is not None and character.has_sides,
            has_feet=character is not None and bool(character.character.feet),
            one_of_several=len(self._names) > 1,
        )
        if self._legend.content != text:
            self._legend.content, self._legend.visible = text, bool(text)

    def show_curves(
        self, characters: Mapping[str, LiveCharacter], samples: Mapping[str, CharacterSample]
    ) -> None:
        """Draw the curves of the character that the panel is about, of these by namespaces."""
        self._characters, below = characters, self._subject.below
        if below in characters and below in samples:
            controller = f"{below}/{topics.CONTROLLER_NODE}"
            self._curves.show(controller, characters[below].character, samples[below])

    def _take_settings(self, values: dict[str, object]) -> None:
        factor, duration = values.get("real_time_factor"), values.get("wrench_duration")
        speed = next((label for label, each in _SPEEDS.items() if each == factor), None)
        if speed is not None:
            self._speed.value = speed
        if isinstance(duration, float):
            self._hands.wrench_durations[self._subject.simulator] = duration

    def tell(self, sentence: str) -> None:
        """Show a sentence, of a node for instance, as it is."""
        self._told.content, self._told.visible = as_text(sentence), bool(sentence)
        self._curves.look_soon()

    def _tell_of(self, node: str, sentence: str) -> None:
        self.tell(f"{node}: {sentence}")

    def _control(self, button: str) -> None:
        node = f"{self._subject.simulator}/{topics.SIM_NODE}"
        tell = partial(self._tell_of, topics.SIM_NODE)
        if button in (_PAUSE, _RESUME):
            content = SetBool.Request(data=button == _PAUSE)
            self.requests.trigger(SetBool, f"{node}/pause", content, tell)
        else:
            service = f"{node}/{button.lower()}"
            self.requests.trigger(Trigger, service, Trigger.Request(), tell)

    def _set_speed(self, label: str) -> None:
        node = f"{self._subject.simulator}/{topics.SIM_NODE}"
        tell = partial(self._tell_of, f"real_time_factor {_SPEEDS[label]:g}")
        self.requests.set(
            node, "real_time_factor", _SPEEDS[label], lambda reason: tell(reason or "set")
        )


def _value_of(handle: Any) -> Callable[[], Any]:
    return lambda: handle.value
