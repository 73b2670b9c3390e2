"""The panel of a timeline that is made: time, keys, joints, and events."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import viser

from actuated_characters.timeline import edits
from actuated_characters.timeline.content import KEYS, TRACKS
from actuated_characters.viewer.controls.actions import ActionQueue
from actuated_characters.viewer.controls.markup import as_text
from actuated_characters.viewer.editor.chosen import Chosen
from actuated_characters.viewer.editor.event_forms import describe_event
from actuated_characters.viewer.editor.event_panel import EventForm
from actuated_characters.viewer.editor.items import Item
from actuated_characters.viewer.editor.joint_panel import JointFields
from actuated_characters.viewer.editor.session import Session
from actuated_characters.viewer.editor.shown_takes import ShownTakes
from actuated_characters.viewer.editor.take_panel import TakePanel
from actuated_characters.viewer.recorded.playback_controls import PlaybackControls, on
from controller_node.references.timeline.description import Ease
from msgs_config.errors import ActuatedCharactersError

_WHOLE, _LIMB = "whole body", "limb alone"
_ALL, _MOVED = "all joints", "joints that moved"
_NONE = "none"
_EASES = tuple(ease.value for ease in Ease)
_STAYS, _LEAVES = "it stays", "it gives way"  # the layer after its last key
_NEVER = "never"


class EditorPanel:
    """The panel of all clients; what it does is done in the thread that runs the actions."""

    def __init__(
        self, gui: viser.GuiApi, session: Session, takes: ShownTakes, actions: ActionQueue
    ) -> None:
        self._gui, self._session, self._actions = gui, session, actions
        self._takes, self.chosen = takes, Chosen(session)
        self._shown: tuple[int, int] | None = None  # the version and the layer that are shown
        self._items = list[Item]()
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        gui.set_panel_label("actuated characters")
        self._state = gui.add_markdown("")
        self._told = gui.add_markdown("", visible=False)
        self._wrong = gui.add_markdown("", visible=False)
        self.time = PlaybackControls(gui, session.playback, actions)
        self._add_edits()
        self._take_panel = TakePanel(gui, session, takes, self.act, self.tell, actions)
        self._add_keys()
        self._add_events()
        self._add_layers()
        with gui.add_folder("Dragging", expand_by_default=False):
            self._moves: Any = gui.add_dropdown("Moves", (_WHOLE, _LIMB))
            self._stands: Any = gui.add_checkbox("Feet stay", initial_value=True)
        with gui.add_folder("Joint", expand_by_default=False):
            self._joint = JointFields(gui, session, self.act, actions)
        self.show()

    @property
    def limb_alone(self) -> bool:
        """Whether a drag moves the limb alone."""
        return bool(self._moves.value == _LIMB)

    @property
    def feet_stay(self) -> bool:
        """Whether links that stand stay during a drag."""
        return bool(self._stands.value)

    def act(self, function: Callable[[], object]) -> None:
        """Do something, and say what was wrong with it."""
        try:
            function()
        except ActuatedCharactersError as error:
            self.tell(f"error: {error}")
        else:
            self.tell("")

    def tell(self, sentence: str) -> None:
        """Show a sentence as it is; none if it is empty."""
        self._told.content = as_text(sentence)
        self._told.visible = bool(sentence)

    def _buttons(self, label: str, functions: Mapping[str, Callable[[], object]]) -> None:
        group: Any = self._gui.add_button_group(label, tuple(functions))
        on(self._actions, group, lambda name: self.act(functions[name]), click=True)

    def _add_edits(self) -> None:
        session, chosen = self._session, self.chosen
        pose = {"Key": session.set_key, "Mirror": chosen.mirror, "Delete": chosen.delete}
        self._buttons("Pose", pose)
        self._buttons("Copies", {"Copy": chosen.copy, "Paste": chosen.paste})
        undo = {"Undo": session.undo, "Redo": session.redo, "Read again": session.read_again}
        self._buttons("File", undo)

    def _add_keys(self) -> None:
        gui, session = self._gui, self._session
        with gui.add_folder("Keys"):
            self._writes: Any = gui.add_dropdown("A key has", (_ALL, _MOVED))
            on(
                self._actions,
                self._writes,
                lambda label: setattr(session, "writes_all", label == _ALL),
            )
            go = {"Previous": partial(self._go_to_key, -1), "Next": partial(self._go_to_key, 1)}
            self._buttons("Go to", go)
            self._ease: Any = gui.add_dropdown("Ease", _EASES)
            on(self._actions, self._ease, lambda ease: self.act(partial(session.set_ease, ease)))
            self._to: Any = gui.add_number("Move to (s)", 0.0, min=0.0, step=0.01)
            self._buttons("This key", {"Move": lambda: session.move_key(float(self._to.value))})

    def _go_to_key(self, steps: int) -> None:
        self.chosen.choose(None)
        self._session.go_to_key(steps)

    def _add_layers(self) -> None:
        gui = self._gui
        with gui.add_folder("Layers", expand_by_default=False):
            self._layer: Any = gui.add_dropdown("Layer", ("",))
            on(self._actions, self._layer, self._choose_layer)
            self._after: Any = gui.add_dropdown(
                "After the last", (_STAYS, _LEAVES), hint="whether steering and clips show again"
            )
            on(self._actions, self._after, lambda label: self.act(partial(self._set_out, label)))
            self._name: Any = gui.add_text("New layer", "")
            self._buttons("Layers", {"Add": self._add_layer, "Remove": self._remove_layer})

    def _choose_layer(self, label: str) -> None:
        if label in self._layer.options:
            self._session.layer = self._layer.options.index(label)

    def _add_layer(self) -> None:
        name = str(self._name.value).strip()
        self._session.add_layer(name or f"layer {len(self._layer.options) + 1}")

    def _remove_layer(self) -> None:
        self._session.edit(edits.delete_layer(self._session.layer))

    def _set_out(self, label: str) -> None:
        out = _NEVER if label == _STAYS else None
        self._session.edit(edits.set_layer(self._session.layer, "out", out))

    def _add_events(self) -> None:
        gui, session = self._gui, self._session
        with gui.add_folder("Events", expand_by_default=False):
            self._event: Any = gui.add_dropdown("There are", (_NONE,))
            on(self._actions, self._event, lambda line: self.act(partial(self._choose_event, line)))
            change = {
                "Go": self._go_to_event,
                "Move here": self._move_event,
                "Copy here": self._copy_event,
            }
            self._buttons("This event", change)
            self._buttons("", {"Delete event": self._delete_event})
            self._form = EventForm(gui, session, TRACKS, self._actions)
            self._buttons("At this time", {"Add event": self._add_event})

    def _add_event(self) -> None:
        self.chosen.add(*self._form.event())

    def _listed_event(self) -> Item | None:
        """What is chosen, else what the list shows."""
        return self.chosen.event or self._event_of(self._event.value)

    def _event_of(self, line: str) -> Item | None:
        options = list(self._event.options)
        return self._items[options.index(line)] if self._items and line in options else None

    def _choose_event(self, line: str) -> None:
        self.chosen.choose(self._event_of(line))

    def _move_event(self) -> None:
        if (item := self._listed_event()) is not None:
            self.chosen.move(item, self._session.time)

    def _copy_event(self) -> None:
        if (item := self._listed_event()) is not None:
            self.chosen.choose(item)
            self.chosen.copy()
            self.chosen.paste()

    def _delete_event(self) -> None:
        if (item := self._listed_event()) is not None:
            self._session.edit(edits.delete_event(item.track, item.number))

    def _go_to_event(self) -> None:
        if (item := self._listed_event()) is not None:
            self._session.playback.plays = False
            at = self._session.document.content[item.track][item.number]["at"]
            self._session.playback.seek(float(at))

    def show(self) -> None:
        """Show where the session is."""
        session = self._session
        self._take_panel.show()
        if (session.version, session.layer) != self._shown:
            self._shown = (session.version, session.layer)
            self._show_content()
        number = session.key
        if self._takes.run is not None:
            what = f"take {self._takes.chosen}"
        elif session.is_posed:
            what = "posed by hand; *Key* keeps it"
        elif number is None:
            what = "between keys" if session.poses else "no keys yet; drag the body, then *Key*"
        else:
            what = f"key {number + 1} of {len(session.poses)}"
        text = f"**{as_text(session.document.file.name)}**  \n{session.time:.3f} s, {what}"
        event = self.chosen.event
        if event is not None:
            line = self._describe(event)
            if self._event.value != line:
                self._event.value = line
            text += f"  \nchosen: {as_text(line)}"
        if self._state.content != text:
            self._state.content = text
            self.time.show_time()
            if number is not None:
                self._ease.value = session.poses[number].get("ease", _EASES[0])
        self._ease.disabled = number is None
        self._joint.show()

    def _describe(self, item: Item) -> str:
        content = self._session.document.content
        return describe_event(item.track, item.number, content[item.track][item.number])

    def _show_content(self) -> None:
        """Have all lists as the document has them."""
        self._wrong.content = "  \n".join(map(as_text, self._session.preview.errors))
        self._wrong.visible = bool(self._session.preview.errors)
        session, content = self._session, self._session.document.content
        layers = content.get(KEYS, [])
        names = [f"{row + 1} {layer.get('name', '')}".strip() for row, layer in enumerate(layers)]
        self._layer.options = tuple(names) or ("",)
        self._layer.value = self._layer.options[session.layer if names else 0]
        out = layers[session.layer].get("out") if names else _NEVER
        self._after.value = _STAYS if out == _NEVER else _LEAVES
        self._after.disabled = not names
        self._take_panel.show_settings(content)
        self._items = [
            Item(track, number) for track in TRACKS for number in range(len(content.get(track, [])))
        ]
        lines = [self._describe(item) for item in self._items]
        chosen = self._event.value
        self._event.options = tuple(lines) or (_NONE,)
        self._event.value = chosen if chosen in lines else self._event.options[0]
        self.time.show_time()
