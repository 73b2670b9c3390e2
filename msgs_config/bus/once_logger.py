"""Warnings that are logged once, though their cause may come again at every tick."""

from msgs_config.bus.node import Log

MOST_LOGGED = 100  # different sentences; a hostile sender must not fill the memory and the log
UNLOGGED = "unlogged_warnings"  # the count's name in the diagnostics
_MAX_CHARACTERS = 1000  # characters of a sentence, which may quote what was received


class OnceLogger:
    """A node's warnings, each sentence once; those beyond `MOST_LOGGED` are only counted."""

    def __init__(self, log: Log) -> None:
        self._log = log
        self._kinds: set[str] = set()
        self._sentences: set[str] = set()
        self.unlogged = 0
        """How many were not logged because so many different ones were; repetitions count."""

    def log_once(self, sentence: str, kind: str = "") -> None:
        """Log a sentence, unless it, or another one of its kind, was logged before.

        Kinds are few, and chosen by the caller: their sentences are always logged.
        """
        if len(sentence) > _MAX_CHARACTERS:
            sentence = sentence[:_MAX_CHARACTERS] + " ..."
        logged, key = (self._kinds, kind) if kind else (self._sentences, sentence)
        if key in logged:
            return
        if len(self._sentences) == MOST_LOGGED and not kind:
            self._count()
            return
        logged.add(key)
        self._log.warning(sentence)

    def has_logged(self, kind: str) -> bool:
        """Whether a sentence of a kind was logged."""
        return kind in self._kinds

    def _count(self) -> None:
        if not self.unlogged:
            self._log.warning(
                f"there were {MOST_LOGGED} different warnings; further ones are not logged, "
                f"but counted ({UNLOGGED} in the diagnostics)"
            )
        self.unlogged += 1
