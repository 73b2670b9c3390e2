"""What is done to that which is chosen on the time line: an event, or the key at the time."""

from collections.abc import Mapping
from typing import Any

from actuated_characters.timeline import edits
from actuated_characters.timeline.mirrored_events import mirrored_event
from actuated_characters.viewer.editor.items import Item
from actuated_characters.viewer.editor.session import Session
from msgs_config.errors import MotionError


class Chosen:
    """An event of a session that is chosen; without one all is done to keys.

    It is known by what it says, not by its number, which other edits change.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._chosen: tuple[str, Mapping[str, Any]] | None = None  # the track, and the event
        self._copied: tuple[str, Mapping[str, Any]] | None = None  # None: what is copied is a key

    @property
    def event(self) -> Item | None:
        """The event that is chosen, as long as it is there, and no pose is made by hand."""
        if self._chosen is None or self._session.is_posed:
            return None
        track, event = self._chosen
        events = self._session.document.content.get(track, [])
        return Item(track, events.index(event)) if event in events else None

    def choose(self, item: Item | None) -> None:
        """Choose an event; or be in the layer of a key, or with None have no event chosen.

        Raises:
            MotionError: there is none of that number.
        """
        self._chosen = None
        if item is None:
            return
        if item.is_key:
            self._find(item)
            self._session.layer = item.layer
        else:
            self._chosen = (item.track, self._find(item))

    def add(self, track: str, event: Mapping[str, Any]) -> None:
        """Add an event to a track, and choose it. Raises as `Session.edit`."""
        self._session.edit(edits.add_event(track, event))
        self._chosen = (track, event)

    def move(self, item: Item, at: float) -> None:
        """Move a key to another time in s, and go there; or an event, and choose it.

        Raises:
            MotionError: there is none of that number, or another key is at that time.
        """
        self.choose(item)
        session = self._session
        if item.is_key:
            session.edit(edits.move_pose(item.layer, item.number, at))
            session.playback.plays = False
            session.playback.seek(at)
        else:
            self._replace(item, edits.event_at(self._find(item), at))

    def end(self, item: Item, at: float) -> None:
        """Have an event end at another time in s, and choose it.

        Raises:
            MotionError: it has no end, or would have it before it begins.
        """
        if not item.lasts:
            raise MotionError(f"{item.track} have no end that could be moved")
        self.choose(item)
        self._replace(item, edits.event_until(self._find(item), at))

    def mirror(self) -> None:
        """Exchange left and right of what is chosen. Raises as `mirrored_event`, `Session`."""
        item = self.event
        if item is None:
            self._session.mirror()
        else:
            self._replace(
                item, mirrored_event(self._session.character, item.track, self._find(item))
            )

    def copy(self) -> None:
        """Remember what is chosen, or the pose that is seen, for `paste`."""
        item = self.event
        self._copied = None if item is None else (item.track, self._find(item))
        if item is None:
            self._session.copy()

    def paste(self) -> None:
        """Have what was copied at the present time. Raises MotionError if nothing was."""
        session = self._session
        if self._copied is None:
            session.paste()
            return
        track, copied = self._copied
        self.add(track, edits.event_at(copied, session.time))

    def delete(self) -> None:
        """Delete what is chosen. Raises MotionError if that is nothing."""
        item = self.event
        if item is None:
            self._session.delete_key()
        else:
            self._session.edit(edits.delete_event(item.track, item.number))

    def _replace(self, item: Item, event: Mapping[str, Any]) -> None:
        self._session.edit(edits.replace_event(item.track, item.number, event))
        self._chosen = (item.track, event)

    def _find(self, item: Item) -> Mapping[str, Any]:
        """What the document has of an item."""
        found: list[Mapping[str, Any]] = self._session.document.content.get(item.track, [])
        if item.is_key:
            found = found[item.layer]["poses"] if item.layer < len(found) else []
        if item.number >= len(found):
            name = "key" if item.is_key else item.track
            raise MotionError(f"{name} {item.number + 1} is not there any more")
        return found[item.number]
