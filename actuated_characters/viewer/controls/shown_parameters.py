"""Which parameters of the nodes the panel has, and as what it shows them."""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from actuated_characters.viewer.parameters import SHOWN, TOUCH, ViewerSettings
from controller_node.behaviours.factory import BEHAVIOUR_PARAMETERS
from controller_node.control_laws import LAWS
from msgs_config.character.layout import ROOT
from msgs_config.character.model import ROOT_TORQUE, Character
from msgs_config.clips.reading import available_clips
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.messages import topics

SIMULATOR, CONTROLLER = topics.SIM_NODE, topics.CONTROLLER_NODE

TO_TRY, AT_RESET = "To try", "At the next reset"

_FORCE, _TORQUE = f"effort_limit.{ROOT}", f"effort_limit.{ROOT_TORQUE}"


@dataclass(frozen=True)
class ShownParameter:
    """A parameter as a menu of its options, a slider, or (with neither) a checkbox."""

    name: str
    label: str
    options: tuple[str, ...] = ()
    range: tuple[float, float, float] | None = None  # least, most, step
    has_no_limit: bool = False  # the slider's largest value stands for infinity
    at_reset: bool = False  # counts from the next reset on
    nodes: tuple[str, ...] = (CONTROLLER,)  # nodes that have it; the first one's value is shown
    then: tuple[tuple[str, str, str], ...] = ()  # node, name, value: set when this one was taken

    @property
    def key(self) -> tuple[str, str]:
        """The node whose value is shown, and the parameter's name."""
        return self.nodes[0], self.name


_LAW = (
    ShownParameter("law", "Law", options=LAWS.names),
    ShownParameter("gain_scale.p", "Stiffness ×", range=(0.0, 3.0, 0.05)),
    ShownParameter("gain_scale.d", "Damping ×", range=(0.0, 3.0, 0.05)),
    ShownParameter(_FORCE, "Root force (N)", range=(0.0, 2000.0, 10.0), has_no_limit=True),
    ShownParameter(
        _TORQUE,
        "Root torque (N\u00a0m)",
        range=(0.0, 1000.0, 5.0),
        has_no_limit=True,
    ),
)
_BALANCE = (
    ShownParameter("balance.enabled", "Balance"),
    ShownParameter("balance.stiffness", "Balance (N/m)", range=(0.0, 5000.0, 50.0)),
    ShownParameter("balance.damping", "Balance (N s/m)", range=(0.0, 1000.0, 10.0)),
)
_TRACKED_FROM_ITS_START = (
    (CONTROLLER, "reference", "clip"),
    (SIMULATOR, "initial_state", "reference"),
)
_WORLD = (
    ShownParameter(
        "gravity", "Gravity (m/s²)", range=(0.0, 20.0, 0.01), nodes=(SIMULATOR, CONTROLLER)
    ),
    ShownParameter("friction", "Friction, ground", range=(0.0, 2.0, 0.05), nodes=(SIMULATOR,)),
    ShownParameter("link_friction", "Friction, links", range=(0.0, 2.0, 0.05), nodes=(SIMULATOR,)),
)


def parse_slider(text: str) -> ShownParameter:
    """The slider of a text `NODE.NAME LEAST MOST STEP LABEL`.

    Raises:
        ConfigurationError: the text is none of that form.
    """
    name, *numbers = text.split(None, 4) or [""]
    label = numbers.pop() if len(numbers) == 4 else ""
    node, _, parameter = name.partition(".")
    with suppress(ValueError):
        least, most, step = map(float, numbers)
        is_range = math.isfinite(least) and math.isfinite(most) and 0.0 < step <= most - least
        if node in (SIMULATOR, CONTROLLER) and parameter and label and is_range:
            return ShownParameter(parameter, label, range=(least, most, step), nodes=(node,))
    raise ConfigurationError(
        f"control '{text}': write it as '{CONTROLLER}.law', of a parameter that the page has, or "
        f"as '{CONTROLLER}.gain_scale.p 0 3 0.05 Stiffness', a slider: least, most, step, label"
    )


def check_settings(settings: ViewerSettings) -> None:
    """Raise ConfigurationError if the page cannot have what it is set to have."""
    check_controls(settings.controls)
    for key, names, known in (
        ("hidden", settings.hidden, list(SHOWN)),
        ("opened", settings.opened, [TOUCH]),
    ):
        for name in names:
            if name not in known:
                raise ConfigurationError(one_of(f"'{key}'", name, known))


def check_controls(texts: Sequence[str]) -> None:
    """Raise ConfigurationError if a text is none that `shown_parameters` takes of any character."""
    names = [".".join(each.key) for each in (*_LAW, *_BALANCE, *_WORLD)]
    names += [f"{CONTROLLER}.{name}" for name in ("behaviour", "clip")]
    for text in texts:
        if len(text.split()) != 1:
            parse_slider(text)
        elif text not in names and not text.startswith(f"{CONTROLLER}.strength."):
            raise ConfigurationError(one_of("control", text, names))


def shown_parameters(
    character: Character, first: Sequence[str] = (), *, drives_root: bool = True
) -> dict[str, tuple[ShownParameter, ...]]:
    """Those of a character's nodes, by the titles of the panel's folders.

    Args:
        character: Whose joints and clips there are.
        first: Those that come first: sliders, see `parse_slider`, or NODE.NAME of other ones.
        drives_root: Whether a force and a torque at the root are among the commands.
    """
    motion = [ShownParameter("behaviour", "Behaviour", options=BEHAVIOUR_PARAMETERS[0].choices)]
    if clips := available_clips(character):
        motion.insert(
            0, ShownParameter("clip", "Clip", options=tuple(clips), then=_TRACKED_FROM_ITS_START)
        )
    strengths = tuple(
        ShownParameter(f"strength.{name}", name, range=(0.0, 1.0, 0.05))
        for name in character.vector_names
        if name not in character.layout.followers
        if name not in (ROOT, ROOT_TORQUE)
    )
    law = tuple(each for each in _LAW if drives_root or each.name not in (_FORCE, _TORQUE))
    law += _BALANCE if character.feet else ()
    at_reset = tuple(replace(each, at_reset=True) for each in (*motion, *_WORLD))
    folders = {"Controller": law, "Strengths": strengths, AT_RESET: at_reset}
    known = {".".join(each.key): each for own in folders.values() for each in own}
    own = [
        parse_slider(text) if len(text.split()) > 1 else known[text]
        for text in first
        if len(text.split()) > 1 or text in known
    ]
    keys = {each.key for each in own}
    others = {
        title: tuple(each for each in parameters if each.key not in keys)
        for title, parameters in folders.items()
    }
    return {TO_TRY: tuple(own), **others} if own else others
