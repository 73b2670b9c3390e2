"""Which control messages of a page the viewer takes: those of the controls that it has.

viser decodes whatever a page sends, sets the property that it names, and ends the connection, or
the caller, with the first value of another type than it expects. So each message is checked before
viser sees it: its form against viser's own description of it, its value against the control or the
part of the scene that it is about. What the viewer has no use for, such as uploads, is refused.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import fields
from typing import Any

import msgspec
import viser
from viser import _messages as wire

_MOST_TEXT = 1000  # characters of a text field
_MOST_PIXELS = 1 << 14  # the most that a window is wide or high
_MOST_AREA = 1 << 25  # pixels of a picture: a small file may have very many
_MAX_COORDINATE = 1e6  # m, or pixels: what is farther comes from no mouse
_SLIDER_ROUNDING = 1e-9  # a page's slider may miss its own end by this share
_UNIT_TOLERANCE = 1e-3  # a direction's length may differ from one by this
_MAX_SHOWN = 60  # characters of a value that a line shows
_PNG_HEAD = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR"

_Fault = str | None
_ERRORS_OF_MALFORMED = (msgspec.MsgspecError, OverflowError, ValueError)


class MessageCheck:
    """Checks the messages for one server of viser's, in its thread."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._gui, self._scene = server.gui, server.scene
        self._checks: dict[type, Callable[[Any], _Fault]] = {
            wire.ViewerCameraMessage: _camera_fault,
            wire.GuiUpdateMessage: self._update_fault,
            wire.GuiButtonHoldMessage: self._hold_fault,
            wire.CommandTriggerMessage: self._command_fault,
            wire.SceneNodeClickMessage: self._click_fault,
            wire.SceneNodeDragMessage: self._node_fault,
            wire.GetRenderResponseMessage: _picture_fault,
        }
        self._types = {each.__name__: each for each in self._checks}

    def find_fault(self, raw: bytes | str, *, awaits_picture: bool) -> str | None:
        """The reason to drop a message as it came, None if there is none.

        `awaits_picture`: whether the page was asked for what it shows.
        """
        if not isinstance(raw, bytes):
            return "it is text, not msgpack"
        try:
            return self._message_fault(msgspec.msgpack.decode(raw), awaits_picture)
        except _ERRORS_OF_MALFORMED as error:
            return f"it is no msgpack: {error}"
        except RecursionError:
            return "it is nested too deep"

    def _message_fault(self, content: object, awaits_picture: bool) -> _Fault:
        if not isinstance(content, dict):
            return f"it is {_shown(content)}, not a map"
        name = content.pop("type", None)
        kind = self._types.get(name) if isinstance(name, str) else None
        is_unasked = kind is wire.GetRenderResponseMessage and not awaits_picture
        if kind is None or is_unasked:
            return f"its type {_shown(name)} is none that this page has a use for"
        return self._content_fault(kind, content)

    def _content_fault(self, kind: type, content: dict[Any, object]) -> _Fault:
        unknown = [key for key in content if key not in {field.name for field in fields(kind)}]
        if unknown:
            return f"{kind.__name__} has no {_shown(unknown[0])}"
        try:
            message: Any = msgspec.convert(content, kind)
        except _ERRORS_OF_MALFORMED as error:
            return f"{kind.__name__}: {error}"
        if kind is not wire.GetRenderResponseMessage and not _is_near(content.values()):
            return f"{kind.__name__} has a number that is not finite, or beyond {_MAX_COORDINATE:g}"
        fault = self._checks[kind](message)
        return fault and f"{kind.__name__}: {fault}"

    def _update_fault(self, message: wire.GuiUpdateMessage) -> _Fault:
        handle = self._gui._gui_input_handle_from_uuid.get(message.uuid)
        if handle is None:
            return f"there is no control {_shown(message.uuid)}"
        if list(message.updates) != ["value"]:
            return f"it sets {_shown(list(message.updates))}; a page sets the value alone"
        if getattr(handle, "disabled", False):
            return f"'{_label(handle)}' is disabled"
        allowed = _value_fault(handle, message.updates["value"])
        return allowed and f"'{_label(handle)}' is {_shown(message.updates['value'])}; {allowed}"

    def _hold_fault(self, message: wire.GuiButtonHoldMessage) -> _Fault:
        handle = self._gui._gui_input_handle_from_uuid.get(message.uuid)
        if not isinstance(handle, viser.GuiButtonHandle):
            return f"there is no button {_shown(message.uuid)}"
        if message.frequency not in handle._button_impl.hold_cbs_from_freq:
            return f"'{_label(handle)}' is not held at {message.frequency:g} Hz"
        return None

    def _command_fault(self, message: wire.CommandTriggerMessage) -> _Fault:
        if message.uuid not in self._gui._command_handle_from_uuid:
            return f"there is no command {_shown(message.uuid)}"
        return None

    def _click_fault(self, message: wire.SceneNodeClickMessage) -> _Fault:
        length = math.hypot(*message.ray_direction)
        if abs(length - 1.0) > _UNIT_TOLERANCE:
            return f"its direction has the length {length:g}, not 1"
        return self._node_fault(message)

    def _node_fault(
        self, message: "wire.SceneNodeClickMessage | wire.SceneNodeDragMessage"
    ) -> _Fault:
        if message.name not in self._scene._handle_from_node_name or message.owner:
            return f"there is no {_shown(message.name)} in the scene"
        return None


def _value_fault(handle: Any, value: Any) -> _Fault:
    """What the value of a control may be, where this one may not be it."""
    if isinstance(handle, viser.GuiDropdownHandle | viser.GuiButtonGroupHandle):
        options = tuple(handle.options)
        return None if value in options else f"it must be one of {', '.join(options)}"
    if isinstance(handle, viser.GuiCheckboxHandle | viser.GuiButtonHandle):
        return None if isinstance(value, bool) else "it must be true or false"
    if isinstance(handle, viser.GuiTextHandle):
        is_short = isinstance(value, str) and len(value) <= _MOST_TEXT
        return None if is_short else f"it must be a text of at most {_MOST_TEXT} characters"
    if isinstance(handle, viser.GuiSliderHandle | viser.GuiNumberHandle):
        least = -math.inf if handle.min is None else handle.min
        most = math.inf if handle.max is None else handle.max
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        is_within = is_number and least - _SLIDER_ROUNDING <= value <= most + _SLIDER_ROUNDING
        return None if is_within else f"it must be a number from {least:g} to {most:g}"
    return "it takes none"


def _camera_fault(message: wire.ViewerCameraMessage) -> _Fault:
    size = message.image_width, message.image_height
    if not all(0 <= pixels <= _MOST_PIXELS for pixels in size):
        return f"its window has {size[0]} x {size[1]} pixels"
    if not 0.0 < message.fov < math.pi:
        return f"its field of view is {message.fov:g} rad"
    return None


def _picture_fault(message: wire.GetRenderResponseMessage) -> _Fault:
    """Why it is no picture; an empty one is how viser's page says that it could take none."""
    head = message.payload[: len(_PNG_HEAD) + 8]
    if not head:
        return None
    width, height = (int.from_bytes(head[at : at + 4], "big") for at in (16, 20))
    is_sized = 0 < width * height <= _MOST_AREA
    if len(head) < len(_PNG_HEAD) + 8 or not head.startswith(_PNG_HEAD) or not is_sized:
        return "it is no PNG of a window"
    return None


def _is_near(values: Iterable[object]) -> bool:
    """Whether all numbers in there are finite, and no larger than a page's can be."""
    for value in values:
        if isinstance(value, dict):
            value = list(value.values())
        if isinstance(value, list | tuple):
            if not _is_near(value):
                return False
        elif isinstance(value, int | float) and not abs(value) <= _MAX_COORDINATE:
            return False
    return True


def _label(handle: Any) -> str:
    return str(getattr(handle, "label", ""))


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= _MAX_SHOWN else f"{text[:_MAX_SHOWN]} ..."
