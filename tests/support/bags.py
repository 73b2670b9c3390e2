"""Bags for tests, written as a recorder writes them, of states that were made in the process."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from rclpy.serialization import serialize_message
from std_msgs.msg import String

from actuated_characters.bags.writer import BagWriter
from actuated_characters.metrics.run_metrics import Tick
from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import RunPlan, make_plan
from msgs_config.messages import configuration, topics
from msgs_config.messages.joint_state import JointStateEncoder
from msgs_config.messages.state import StampedReference, StampedState
from msgs_config.messages.topic import Topic
from msgs_config.messages.wrenches import WrenchArrays, encode_wrenches

REFERENCE = topics.REFERENCE.of(topics.CONTROLLER_NODE)
CONFIGURATION = topics.CONFIGURATION.of(topics.SIM_NODE)

RawMessage = tuple[Topic, bytes]
"""A topic and a message on it, serialised."""


@dataclass(frozen=True)
class Made:
    """A run that was made in the process."""

    plan: RunPlan
    ticks: list[Tick]

    @property
    def states(self) -> list[StampedState]:
        """The states, each once."""
        return [self.ticks[0].state, *(tick.following for tick in self.ticks)]

    def messages(self) -> list[RawMessage]:
        """What a recorder hears of it."""
        references = [tick.reference for tick in self.ticks if tick.reference is not None]
        return [
            raw_configuration(self.plan),
            *raw_states(self.plan, self.states),
            *raw_references(self.plan, references),
        ]


def make_run(
    character: str,
    duration: float,
    reference: dict[str, object] | None = None,
    **simulator: object,
) -> Made:
    """Run simulator and controller in this process."""
    plan = make_plan(character, duration, reference or {"reference": "hold"}, simulator, {})
    return Made(plan, list(ticks_in_process(plan)))


def raw_configuration(plan: RunPlan, name: str = "", characters: Sequence[str] = ()) -> RawMessage:
    text = configuration.describe(plan.character, plan.simulator, name=name, characters=characters)
    return CONFIGURATION, serialize_message(String(data=text))


def raw_states(plan: RunPlan, states: Iterable[StampedState]) -> list[RawMessage]:
    encoder = JointStateEncoder(plan.character.layout.dof_names)
    messages = []
    for state in states:
        effort = () if state.effort is None else (state.effort,)
        raw = encoder.encode(state.stamp_ns, state.position, state.velocity, *effort)
        messages.append((topics.JOINT_STATES, raw))
    return messages


def raw_references(plan: RunPlan, references: Iterable[StampedReference]) -> list[RawMessage]:
    encoder = JointStateEncoder(plan.character.layout.dof_names)
    return [(REFERENCE, encoder.encode(r.stamp_ns, r.position, r.velocity)) for r in references]


def raw_wrenches(topic: Topic, wrenches: Iterable[WrenchArrays]) -> list[RawMessage]:
    return [(topic, encode_wrenches(each)) for each in wrenches]


def write_bag(path: Path, messages: Sequence[RawMessage], namespace: str = "") -> Path:
    """Write a bag of messages in the order given; the directory."""
    return write_timed(path, _numbered(messages), namespace)


def add_to(bag: BagWriter, messages: Sequence[RawMessage], namespace: str = "") -> None:
    """Write messages into a bag that is open, all their topics in one namespace."""
    add_timed(bag, _numbered(messages), namespace)


def _numbered(messages: Sequence[RawMessage]) -> list[tuple[RawMessage, int]]:
    """Messages a nanosecond apart."""
    return [(message, 1_000_000 + number) for number, message in enumerate(messages)]


def write_timed(
    path: Path, messages: Sequence[tuple[RawMessage, int]], namespace: str = ""
) -> Path:
    """Write a bag of messages with their wall times, in the order given; the directory."""
    with BagWriter(path) as bag:
        add_timed(bag, messages, namespace)
    return path


def add_timed(
    bag: BagWriter, messages: Sequence[tuple[RawMessage, int]], namespace: str = ""
) -> None:
    """Write messages with their wall times into a bag that is open."""
    names = {f"/{topic.under(namespace).name}": topic for (topic, _), _ in messages}
    for name, topic in names.items():
        bag.add_topic(name, topic.type_name, topic.quality)
    for (topic, raw), log_time_ns in messages:
        bag.write(f"/{topic.under(namespace).name}", raw, log_time_ns)
