"""What is known of a topic: its name, type and quality of service, and what others do with it.

A `Topic` knows ROS by name alone; only who asks for its message type or its profile needs ROS.
"""

from dataclasses import dataclass, replace
from enum import Enum, auto
from functools import lru_cache
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rclpy.qos import QoSProfile

LISTENING_DEPTH = 50_000
"""Depth of a reader whose process may be busy otherwise for long, with a disk for instance.

It costs nothing until it is needed, unlike a publisher's."""


@dataclass(frozen=True)
class Quality:
    """A quality of service that keeps the last messages."""

    depth: int
    is_latched: bool = False  # whether late subscribers get the last messages
    is_reliable: bool = True

    @property
    def profile(self) -> "QoSProfile":
        """The same for rclpy."""
        return _profile(self)


@lru_cache
def _profile(quality: Quality) -> "QoSProfile":
    from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

    durability, reliability = DurabilityPolicy, ReliabilityPolicy
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=quality.depth,
        reliability=reliability.RELIABLE if quality.is_reliable else reliability.BEST_EFFORT,
        durability=durability.TRANSIENT_LOCAL if quality.is_latched else durability.VOLATILE,
    )


STREAM = Quality(5000)
"""With a small history a recorder that pauses for a moment loses messages."""
LATCHED = Quality(1, is_latched=True)
CHANGES = Quality(100, is_latched=True)
"""For values that may change twice at once: a listener of depth 1 has the last, a recorder all."""
DISPLAY = Quality(1000)
"""A viewer's own depth may be 1; a recorder's is not."""


class Kept(Enum):
    """Whether the recorder records a topic."""

    NEVER = auto()
    IF_NAMED = auto()  # it is kept if a parameter names it
    UNLESS_EXCLUDED = auto()
    ALWAYS = auto()  # nothing can be measured or repeated without


class SessionPlace(Enum):
    """Where a message names the session of the simulator that it is of, or for."""

    NOWHERE = auto()
    FRAME_ID = auto()
    FRAME_ID_IF_ANY = auto()  # without a name it is for any simulator
    EPISODE = auto()  # it stands in `frame_id`, behind the episode's number
    CONFIGURATION = auto()  # it stands in the configuration's JSON


@dataclass(frozen=True)
class Topic:
    """A topic of the contract. A name that begins with `~` is below its node's name."""

    name: str
    type_name: str  # ROS' name of the type: PACKAGE/msg/TYPE
    quality: Quality
    way: str = ""  # says from whom to whom it goes, for the documentation
    nodes: tuple[str, ...] = ()  # the nodes whose name `~` stands for
    of_world: bool = False  # one of all characters in a world together, not one of each
    kept: Kept = Kept.UNLESS_EXCLUDED
    session: SessionPlace = SessionPlace.NOWHERE
    is_measured: bool = False  # whether the figures of a run need it
    # whether the simulator sends one at each tick, which begins with its stamp: players send it too
    is_of_tick: bool = False
    accepted_on: str = ""  # the topic on which a node says which requests it has accepted
    content: str = ""  # says what it has, for the documentation

    @property
    def message_type(self) -> type:
        """The class of its messages.

        Raises:
            ImportError: its package is not installed.
        """
        return find_message_class(self.type_name)

    @property
    def qos(self) -> "QoSProfile":
        """Its quality of service for rclpy."""
        return self.quality.profile

    @property
    def is_installed(self) -> bool:
        """Whether the package of its message type is; that of `/tf` is not among the wheels.

        Where there is no ROS at all, a run in one process has all topics: no other run lacks one.
        """
        packages = self.type_name.partition("/")[0], "rclpy"
        return find_spec(packages[0]) is not None or find_spec(packages[1]) is None

    def of(self, node_name: str) -> "Topic":
        """The topic as another node names it: `~` is the node that publishes it."""
        return replace(self, name=self.name.replace("~", node_name))

    @property
    def as_others_name_it(self) -> tuple["Topic", ...]:
        """The topic, or one of each node that `~` stands for."""
        return tuple(self.of(node) for node in self.nodes) or (self,)

    @property
    def throttled(self) -> "Topic":
        """The topic with some of its messages, a few a second of wall time, for viewers."""
        some = f"of `{self.name}` the first message in each sixtieth of a second of wall time"
        return Topic(
            f"{self.name}_throttle",
            self.type_name,
            DISPLAY,
            self.way,
            self.nodes,
            kept=Kept.NEVER,
            content=f"{some}, and the last one; for displays alone",
        )

    def under(self, namespace: str) -> "Topic":
        """The topic below a namespace; with an empty one it is the topic itself."""
        return replace(self, name=f"{namespace}/{self.name}") if namespace else self

    def for_listener(self, depth: int = LISTENING_DEPTH) -> "Topic":
        """The topic with a queue deep enough for a listener that polls rarely."""
        return replace(self, quality=replace(self.quality, depth=depth))


@lru_cache
def find_message_class(type_name: str) -> type:
    """The class of a message type, as `sensor_msgs/msg/JointState`.

    Raises:
        ImportError, AttributeError, ValueError: it is not installed, or is no type's name.
    """
    package, _, name = type_name.replace("/", ".").rpartition(".")
    found: type = getattr(import_module(package), name)
    return found
