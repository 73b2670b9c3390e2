"""The messages of a bag, by the character or the world that they are of."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from actuated_characters.bags.reader import RecordedMessage
from actuated_characters.bags.tracks import CharacterTimeline, WorldTimeline
from msgs_config.errors import ActuatedCharactersError


@contextmanager
def naming(bag: Path, timeline: CharacterTimeline | WorldTimeline) -> Iterator[None]:
    """Let errors begin with the bag and the namespace."""
    try:
        yield
    except ActuatedCharactersError as error:
        where = f"{bag}, '{timeline.namespace}'" if timeline.namespace else f"{bag}"
        raise type(error)(f"recording {where}: {error}") from error


def collect(
    bag: Path, messages: Iterable[RecordedMessage]
) -> tuple[list[CharacterTimeline], dict[str, WorldTimeline]]:
    """Collect the messages of a bag by namespace, on topics that have the contract's names."""
    characters: dict[str, CharacterTimeline] = {}
    worlds: dict[str, WorldTimeline] = {}
    # by topic: the timeline of its namespace, and the topic's name in that
    places: dict[str, tuple[CharacterTimeline | WorldTimeline, str] | None] = {}
    for message in messages:
        topic = message.topic
        if topic not in places:
            places[topic] = _timeline(topic, WorldTimeline, worlds) or _timeline(
                topic, CharacterTimeline, characters
            )
        if (place := places[topic]) is not None:
            timeline, name = place
            try:
                timeline.has_wall_times &= message.published_ns is not None
                timeline.take(name, message.raw, message.sent_ns)
            except ActuatedCharactersError:
                with naming(bag, timeline):
                    raise
    return list(characters.values()), worlds


_Timeline = TypeVar("_Timeline", CharacterTimeline, WorldTimeline)


def _timeline(
    topic: str, kind: type[_Timeline], timelines: dict[str, _Timeline]
) -> tuple[_Timeline, str] | None:
    """The timeline that takes a topic's messages, and its name there; None if none of a kind."""
    for name in kind.TOPICS:
        if f"/{topic}".endswith(f"/{name}"):
            namespace = topic.removesuffix(name).strip("/")
            return timelines.setdefault(namespace, kind(namespace)), name
    return None
