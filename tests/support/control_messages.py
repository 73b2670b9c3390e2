"""Control messages as viser's page sends them to its server, and mutations of such messages."""

import copy
import math
import random
from collections.abc import Iterator, Sequence
from typing import Any

import msgspec

CAMERA: dict[str, Any] = {
    "type": "ViewerCameraMessage",
    "wxyz": [0.5, -0.5, 0.5, -0.5],
    "position": [2.6, -2.6, 1.5],
    "fov": 1.3,
    "near": 0.01,
    "far": 1000,
    "image_height": 600,
    "image_width": 800,
    "look_at": [0, 0, 0.8],
    "up_direction": [0, 0, 1],
}
DRAG: dict[str, Any] = {
    "type": "SceneNodeDragMessage",
    "phase": "start",
    "name": "/mesh",
    "instance_index": None,
    "start_position": [0, 0, 1],
    "start_screen_pos": [0.5, 0.5],
    "end_position": [0.2, 0, 1],
    "end_screen_pos": [0.6, 0.5],
    "button": "left",
    "modifier": None,
    "owner": "",
}
CLICK: dict[str, Any] = {
    "type": "SceneNodeClickMessage",
    "name": "/mesh",
    "instance_index": None,
    "ray_origin": [2.6, -2.6, 1.5],
    "ray_direction": [0.6, 0, -0.8],
    "screen_pos": [0.5, 0.5],
    "modifier": "shift",
    "owner": "",
}

_ODD: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 5, 2**31, 2**63, -(2**63), 0.5, 1e308, -1e308, 5e-324),
    *(math.nan, math.inf, -math.inf, "", "5", "1e9", "\x00", "é" * 300, "../..", "<img src=x>"),
    *(b"", b"\x00\xff", [], [1], [[[]]], list(range(500)), {}, {"value": 5}, {"": {"": []}}),
)


def mutations(
    originals: Sequence[dict[str, Any]], count: int, generator: random.Random
) -> Iterator[bytes]:
    """So many messages that each differ from one of some, serialised as msgpack."""
    for _ in range(count):
        message = copy.deepcopy(generator.choice(originals))
        kind = generator.randrange(6)
        if kind < 3:
            _replace_one(message, generator)
        raw = msgspec.msgpack.encode(message)
        if kind == 3:
            raw = raw[: generator.randrange(len(raw))]
        elif kind == 4:
            changed = bytearray(raw)
            for _ in range(generator.randrange(1, 8)):
                changed[generator.randrange(len(raw))] = generator.randrange(256)
            raw = bytes(changed)
        elif kind == 5:
            raw += generator.randbytes(generator.randrange(1, 100))
        yield raw


def _replace_one(message: dict[str, Any], generator: random.Random) -> None:
    """Replace, drop or add a field, at any depth."""
    part: Any = message
    while True:
        keys = list(part) if isinstance(part, dict) else list(range(len(part)))
        if not keys:
            return
        key = generator.choice(keys)
        if isinstance(part[key], dict | list) and part[key] and generator.random() < 0.7:
            part = part[key]
            continue
        act = generator.randrange(4)
        if act == 0 and isinstance(part, dict):
            del part[key]
        elif act == 1 and isinstance(part, dict):
            part[generator.choice(("extra", "excluded_self_client", ""))] = generator.choice(_ODD)
        else:
            part[key] = generator.choice(_ODD)
        return
