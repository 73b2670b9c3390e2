"""The messages of a bag, by the character or the world that they are of."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from actuated_characters.bags.character_timeline import CharacterTimeline
from actuated_characters.bags.keyframes import KeyframePlace
from actuated_characters.bags.reader import RecordedMessage, read_messages, read_topics
from actuated_characters.bags.world_timeline import Beginnings, WorldTimeline
from msgs_config.errors import ActuatedCharactersError
from msgs_config.messages import topics

_EARLIER_NS = 200_000_000  # ns by which messages of one tick may be apart, on a busy machine
_LATCHED = tuple(
    f"/{topic.name}"
    for each in topics.TABLE
    if each.quality.is_latched
    for topic in each.as_others_name_it
    if topic.name in WorldTimeline.TOPICS + CharacterTimeline.TOPICS
)


@contextmanager
def naming(bag: Path, timeline: CharacterTimeline | WorldTimeline) -> Iterator[None]:
    """Let errors begin with the bag and the namespace."""
    try:
        yield
    except ActuatedCharactersError as error:
        where = f"{bag}, '{timeline.namespace}'" if timeline.namespace else f"{bag}"
        raise type(error)(f"recording {where}: {error}") from error


def collect(
    bag: Path,
    begin: KeyframePlace | None = None,
    messages: Iterable[RecordedMessage] | None = None,
) -> tuple[list[CharacterTimeline], dict[str, WorldTimeline]]:
    """Collect the messages of each namespace, on topics that have the contract's names.

    From the place of a keyframe on, where there is one, but the latched ones from the start; or
    those that are given.
    """
    characters: dict[str, CharacterTimeline] = {}
    worlds: dict[str, WorldTimeline] = {}
    begins, first_ns, latched = Beginnings(), 0, list[str]()
    if begin is not None:
        begins.first_ns = begin.stamp_ns
        begins.keyframes.add(begin.stamp_ns)  # it may come behind its state
        first_ns = begin.log_time_ns - _EARLIER_NS
        latched = [name for name in read_topics(bag) if name.endswith(_LATCHED)]
    # by topic: the timeline of its namespace, and the topic's name in that
    places: dict[str, tuple[CharacterTimeline | WorldTimeline, str] | None] = {}
    if messages is None:
        messages = read_messages(bag, first_ns=first_ns, whole=latched)
    for message in messages:
        topic = message.topic
        if topic not in places:
            places[topic] = _timeline(topic, WorldTimeline, worlds, begins) or _timeline(
                topic, CharacterTimeline, characters, begins
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
    topic: str, kind: type[_Timeline], timelines: dict[str, _Timeline], begins: Beginnings
) -> tuple[_Timeline, str] | None:
    """The timeline that takes a topic's messages, and its name there; None if none of a kind."""
    for name in kind.TOPICS:
        if f"/{topic}".endswith(f"/{name}"):
            namespace = topic.removesuffix(name).strip("/")
            return timelines.setdefault(namespace, kind(namespace, begins)), name
    return None
