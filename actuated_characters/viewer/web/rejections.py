"""What the viewer's server has rejected, from its thread to the one that tells the user."""

from collections import deque

_MOST_WAITING = 100  # sentences between two looks
_MOST_TOLD = 100  # different sentences: a hostile sender must not fill memory and log
_MAX_CHARACTERS = 300  # characters of a sentence


class Rejections:
    """Sentences, each told once."""

    def __init__(self) -> None:
        self._untold: deque[str] = deque(maxlen=_MOST_WAITING)
        self._told: set[str] = set()
        self.note = self._untold.append
        """Notes a sentence; for any thread."""

    def take(self) -> list[str]:
        """The sentences since the last call that were not told before."""
        new = []
        while self._untold and len(self._told) <= _MOST_TOLD:
            sentence = self._untold.popleft()[:_MAX_CHARACTERS]
            if len(self._told) == _MOST_TOLD:
                sentence = f"more than {_MOST_TOLD} different rejections; further ones are not told"
            if sentence not in self._told:
                self._told.add(sentence)
                new.append(sentence)
        return new
