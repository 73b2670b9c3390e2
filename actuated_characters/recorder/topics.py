"""Which topics are recorded: those of the contract, and others that are asked for by name."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from actuated_characters.recorder.parameters import RecorderSettings
from msgs_config.bus.node import BusNode
from msgs_config.character.sensors import SensorType
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.messages import topics
from msgs_config.messages.topic import Kept, Topic

# The streams come last: when a publisher of theirs sees its subscriber, all others are there too.
_RECORDED_TOPICS = [
    topic
    for each in reversed(topics.TABLE)
    if each.kept in (Kept.UNLESS_EXCLUDED, Kept.ALWAYS) and each.is_installed
    for topic in each.as_others_name_it
]
EXCLUDABLE = sorted(topic.name for topic in _RECORDED_TOPICS if topic.kept is not Kept.ALWAYS)
"""Topics that a recording may do without."""


@dataclass(frozen=True)
class RecordedTopic:
    """A topic that the recorder subscribes to."""

    topic: Topic  # its name below the recorder's namespace
    name: str  # absolute name in the bag
    own_name: str  # name below its character's namespace
    character: str | None  # None if the topic is of all characters, or of none


def wanted_topics(node: BusNode, settings: RecorderSettings) -> list[RecordedTopic]:
    """The topics that the recorder's settings say, in the order to subscribe.

    Raises:
        ConfigurationError: a name is wrong.
    """
    has_bag, names = settings.write_bag, settings.names
    found = contract_topics(node, names, settings.exclude, measured_only=not has_bag)
    # The sensors come first: the simulator begins when its states have all their subscribers.
    return (sensor_topics(node, settings.sensors) if has_bag else []) + found


def contract_topics(
    node: BusNode, characters: Sequence[str], exclude: Sequence[str], *, measured_only: bool
) -> list[RecordedTopic]:
    """The contract's topics of these characters but the excluded ones, in the order to subscribe.

    Args:
        node: The recorder, in whose namespace the characters are.
        characters: Their names; that of a character alone in its namespace is empty.
        exclude: Names of topics, below each character or resolved.
        measured_only: Take only the topics that the figures are made of.

    Raises:
        ConfigurationError: a name is of no topic that can be left out, or of no character.
    """
    twice = [name for name, count in Counter(characters).items() if count > 1]
    if twice:
        raise ConfigurationError(f"parameter 'characters' has '{twice[0]}' twice")
    check_names(node, "characters", characters)
    found = [_recorded(node, topic, None) for topic in _RECORDED_TOPICS if topic.of_world]
    of_each = [topic for topic in _RECORDED_TOPICS if not topic.of_world]
    found += [_recorded(node, topic, name) for topic in of_each for name in characters]
    left_out: list[RecordedTopic] = []
    for name in exclude:
        matching = [each for each in found if name in (each.own_name, each.name)]
        if not matching or any(each.own_name not in EXCLUDABLE for each in matching):
            wrong = one_of("topic to exclude:", name, EXCLUDABLE)
            raise ConfigurationError(f"parameter 'exclude': {wrong}")
        left_out += matching
    return [
        each
        for each in found
        if each not in left_out and (each.topic.is_measured or not measured_only)
    ]


def sensor_topics(node: BusNode, names: Sequence[str]) -> list[RecordedTopic]:
    """The topics of sensors, by their names below the recorder's namespace.

    Raises:
        ConfigurationError: a name is not one that a sensor's topic can have.
    """
    check_names(node, "sensors", names)
    types = {each.value: each for each in SensorType}
    found = []
    for name in names:
        kind = name.split("/")[-2:-1]
        if not (kind and kind[0] in types):
            raise ConfigurationError(
                f"parameter 'sensors' has {name!r}; it must be the topic of a sensor, such as "
                f"{' or '.join(f'{each}/NAME' for each in types)}"
            )
        topic = topics.sensor_reading(types[kind[0]], name)
        found.append(RecordedTopic(topic, node.resolve_topic_name(name), name, None))
    return found


def simulator_name(node: BusNode, character: str) -> str:
    """The name of the simulator's status on `/diagnostics` that is about a character."""
    below = f"{character}/" if character else ""
    return node.resolve_topic_name(f"{below}{topics.SIM_NODE}").lstrip("/")


def _recorded(node: BusNode, topic: Topic, character: str | None) -> RecordedTopic:
    below = topic.under(character or "")
    return RecordedTopic(below, node.resolve_topic_name(below.name), topic.name, character)


def check_names(node: BusNode, parameter: str, names: Sequence[str]) -> None:
    """Raise ConfigurationError if one of a parameter's names is none for ROS."""
    for name in filter(None, names):
        if fault := node.name_fault(name):
            raise ConfigurationError(f"parameter '{parameter}' has {name!r}: {fault}")
