"""What stands on the time line of a timeline and can be taken: keys and events."""

import re
from dataclasses import dataclass

from actuated_characters.timeline.content import KEYS, TRACKS
from msgs_config.errors import MotionError

_MOMENTS = (KEYS, "pushes", "throws")
_FORM = re.compile(rf"({KEYS})/(\d{{1,6}})/(\d{{1,6}})|({'|'.join(TRACKS)})/(\d{{1,6}})")


@dataclass(frozen=True)
class Item:
    """A key or an event, by its numbers from 0; as a text `keys/LAYER/NUMBER`, `TRACK/NUMBER`."""

    track: str
    number: int  # of the event in its track, or of the key in its layer
    layer: int = 0  # of a key

    @property
    def is_key(self) -> bool:
        """Whether it is a key."""
        return self.track == KEYS

    @property
    def lasts(self) -> bool:
        """Whether it has an end: no key, push or throw has."""
        return self.track not in _MOMENTS

    def __str__(self) -> str:
        """What pages call it."""
        layer = f"{self.layer}/" if self.is_key else ""
        return f"{self.track}/{layer}{self.number}"


def parse_item(text: str) -> Item:
    """What a page means. Raises MotionError if that is nothing."""
    found = _FORM.fullmatch(text)
    if found is None:
        raise MotionError(f"{text!r} is no key and no event")
    keys, layer, number, track, event = found.groups()
    return Item(keys, int(number), int(layer)) if keys else Item(track, int(event))
