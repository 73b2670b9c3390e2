"""Events with left and right exchanged, in the plane y = 0, as poses are."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from actuated_characters.timeline.content import is_number
from character_motion.clips.mirroring import counterpart_among
from msgs_config.character.model import Character
from msgs_config.errors import MotionError

_LINKS, _JOINTS = ("link", "target"), "joints"
_VECTORS = {"point": (1, -1, 1), "force": (1, -1, 1), "velocity": (1, -1, -1)}
"""What of a vector changes its sign: a turn about the vertical does, as y does."""
_SIDE, _SIDES = "from", {"left": "right", "right": "left"}


def mirrored_event(character: Character, track: str, event: Mapping[str, Any]) -> dict[str, Any]:
    """The image of an event: of links and joints those on the other side, of vectors -y.

    What has no side stays, and so does what is no value of its kind.

    Raises:
        MotionError: it is a clip, whose image would be another file.
    """
    if track == "clips":
        raise MotionError(
            "a clip is mirrored as a file: `actuated_characters motion mirror` makes its image"
        )
    links = tuple(link.name for link in character.links)
    image: dict[str, Callable[[Any], Any]] = {
        _JOINTS: partial(_mirrored_names, character.layout.joint_names),
        _SIDE: _mirrored_side,
        **{name: partial(_mirrored_name, links) for name in _LINKS},
    }
    for name, signs in _VECTORS.items():
        image[name] = partial(_mirrored_vector, signs)
    return {name: image[name](value) if name in image else value for name, value in event.items()}


def _mirrored_name(names: Sequence[str], name: Any) -> Any:
    return counterpart_among(names, name) if isinstance(name, str) else name


def _mirrored_names(names: Sequence[str], given: Any) -> Any:
    return [_mirrored_name(names, name) for name in given] if isinstance(given, list) else given


def _mirrored_side(side: Any) -> Any:
    """The side that a ball comes from, by its name or as degrees to the left."""
    try:
        return _SIDES[side] if side in _SIDES else -float(side) + 0.0  # no negative zero
    except (TypeError, ValueError):
        return side


def _mirrored_vector(signs: tuple[int, int, int], vector: Any) -> Any:
    if not isinstance(vector, list) or len(vector) != len(signs) or not all(map(is_number, vector)):
        return vector  # `here` of a pin, or the largest force of one
    # no negative zero
    return [sign * value + 0.0 for sign, value in zip(signs, vector, strict=True)]
