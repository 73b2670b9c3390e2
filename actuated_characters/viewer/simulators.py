"""Finds the simulators in the domain, and rebuilds the characters that they describe."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace

from rclpy.node import Node

from actuated_characters.bags.rebuilding import Rebuilt, rebuild
from actuated_characters.viewer.latest import BallReader, CharacterReader
from msgs_config.bus.polling import DirectSubscription
from msgs_config.errors import ActuatedCharactersError, MessageError
from msgs_config.messages import topics
from msgs_config.messages.cdr import decode_header, decode_string
from msgs_config.messages.session import episode_session

_CONFIGURATION = "/" + topics.CONFIGURATION.of(topics.SIM_NODE).name


@dataclass
class WatchedNamespace:
    """A namespace in which a simulator has published the description of a character."""

    below: str  # its name, which begins with `/` or is empty
    configuration: DirectSubscription
    episode: DirectSubscription
    rebuilt: Rebuilt | None = None
    episode_text: str = ""  # the last episode's number and session
    is_new_episode: bool = False  # since the last call of `Simulators.changed`
    reader: CharacterReader | None = None
    readers_session: str = field(default="", repr=False)

    @property
    def has_begun(self) -> bool:
        """Whether the first state of the simulator that describes itself was published."""
        if self.rebuilt is None or not self.episode_text:
            return False
        return episode_session(self.episode_text) == self.rebuilt.known.session

    @property
    def place_in_world(self) -> int:
        """Which one of its world it is, from 0 on."""
        world = None if self.rebuilt is None else self.rebuilt.world
        return world.characters.index(world.name) if world and world.name in world.characters else 0

    @property
    def simulator(self) -> str:
        """The namespace of the simulator, which begins with `/` or is empty."""
        return "" if self.rebuilt is None else self.rebuilt.world.topics_below


class WatchedSimulators:
    """All characters of all simulators in a namespace, and the newest that is known of them."""

    def __init__(self, node: Node, namespace: str, log: Callable[[str], None]) -> None:
        """Look below a namespace, which is empty or begins with `/`; `log` gets warnings."""
        self._node, self._namespace, self._log = node, namespace, log
        self._watched: dict[str, WatchedNamespace] = {}
        self._balls: dict[str, tuple[str, BallReader]] = {}  # by the simulator's namespace

    def find_simulators(self) -> None:
        """Subscribe to the descriptions that simulators publish; cheap, but not for each frame."""
        for name, _ in self._node.get_topic_names_and_types():
            below = name.removesuffix(_CONFIGURATION)
            if below == name or not f"{below}/".startswith(f"{self._namespace}/"):
                continue
            if below not in self._watched and self._node.count_publishers(name):
                configuration = replace(topics.CONFIGURATION, name=name)
                episode = replace(topics.EPISODE, name=f"{below}/{topics.EPISODE.name}")
                self._watched[below] = WatchedNamespace(
                    below,
                    DirectSubscription(self._node, configuration),
                    DirectSubscription(self._node, episode),
                )

    def changed(self) -> Iterator[WatchedNamespace]:
        """The characters of which a new description has come since the last call."""
        for watched in list(self._watched.values()):
            self._take_episodes(watched)
            newest = None
            while (raw := watched.configuration.take()) is not None:
                newest = raw
            if newest is None:
                continue
            try:
                text = decode_string(newest)
                watched.rebuilt = rebuild(text, watched.below.lstrip("/"))
            except (ActuatedCharactersError, OSError) as error:
                self._log(f"'{watched.below}{_CONFIGURATION}' cannot be shown: {error}")
                continue
            yield watched

    @staticmethod
    def _take_episodes(watched: WatchedNamespace) -> None:
        before = watched.episode_text
        with suppress(MessageError):
            while (raw := watched.episode.take()) is not None:
                watched.episode_text = decode_header(raw)[1]
        watched.is_new_episode = watched.episode_text != before

    def gone(self) -> list[WatchedNamespace]:
        """Forget the characters without a publisher, if there are others; returns them."""
        silent = [
            each
            for each in self._watched.values()
            if not self._node.count_publishers(each.below + _CONFIGURATION)
        ]
        if len(silent) == len(self._watched):
            return []  # the last picture stays
        for each in silent:
            self._close(each)
            each.configuration.close()
            each.episode.close()
            del self._watched[each.below]
        return silent

    def watch(self, *, watches: bool) -> None:
        """Subscribe to all streams while anybody watches, and to none otherwise.

        Never before a simulator's first state: a run may wait for so many subscribers, and must not
        take this one for one of those that it needs.
        """
        for each in self._watched.values():
            known = each.rebuilt.known if each.rebuilt is not None else None
            if known is None or not (watches and each.has_begun):
                self._close(each)
                continue
            if each.reader is None or each.readers_session != known.session:
                self._close(each)
                each.readers_session = known.session
                each.reader = CharacterReader(self._node, each.below, known.layout, known.session)
        self._watch_balls()

    def _watch_balls(self) -> None:
        wanted = {
            each.simulator: each.readers_session
            for each in self._watched.values()
            if each.reader is not None
        }
        for simulator, (session, reader) in list(self._balls.items()):
            if wanted.get(simulator) != session:
                reader.close()
                del self._balls[simulator]
        for simulator, session in wanted.items():
            if simulator not in self._balls:
                self._balls[simulator] = session, BallReader(self._node, simulator, session)

    @staticmethod
    def _close(watched: WatchedNamespace) -> None:
        if watched.reader is not None:
            watched.reader.close()
            watched.reader = None

    @property
    def characters(self) -> list[WatchedNamespace]:
        """All characters that are known, those of a world in its own order."""
        known = [each for each in self._watched.values() if each.rebuilt is not None]
        return sorted(known, key=lambda each: (each.simulator, each.place_in_world))

    @property
    def balls(self) -> dict[str, BallReader]:
        """The balls of each simulator, by its namespace."""
        return {simulator: reader for simulator, (_, reader) in self._balls.items()}
