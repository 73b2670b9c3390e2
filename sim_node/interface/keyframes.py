"""The simulator's keyframes: all that it goes on from, published now and then, or given."""

from collections.abc import Iterator

from msgs_config.bus.keyframe_publisher import KeyframePublisher
from msgs_config.bus.node import BusNode
from msgs_config.bus.once_logger import OnceLogger
from msgs_config.bus.publishing import Outgoing
from msgs_config.errors import RecordingError, SimulationError
from msgs_config.memory import MemoryFormat
from msgs_config.messages import topics
from msgs_config.messages.keyframe import read_keyframe
from msgs_config.parameters import Values
from msgs_config.shared_parameters import KeyframeSettings
from sim_node.physics.simulation import Simulation, Snapshot


def keyframe_format(simulation: Simulation) -> MemoryFormat:
    """The form of the keyframes of a simulation that was just made."""
    return MemoryFormat(simulation.settings)


def read_memory(memory: bytes, simulation: Simulation) -> tuple[Snapshot, int]:
    """The state in a keyframe of a simulation like this one, and the stamp of its episode's first.

    Raises:
        RecordingError: the keyframe is of another simulation, or is not opened.
    """
    found = keyframe_format(simulation).read(memory)
    try:
        snapshot, episode_ns = found
        found_kinds = [(len(e.state.position), e.mass_factors) for e in snapshot.characters]
    except (TypeError, ValueError, AttributeError) as error:
        raise RecordingError("a keyframe cannot be used: it is none of a simulator") from error
    kinds = [(each.layout.size, each.setup.mass_factors) for each in simulation.characters]
    if found_kinds != kinds:
        raise RecordingError("a keyframe cannot be used: it is of other characters")
    return snapshot, episode_ns


class SimulatorKeyframes:
    """Publishes keyframes of a simulation, and lets it go on from one that is given."""

    def __init__(
        self,
        node: BusNode,
        simulation: Simulation,
        values: Values,
        session: str,
        logger: OnceLogger,
    ) -> None:
        """Offer the topic, and read the keyframe that the parameters' values name.

        Raises:
            ActuatedCharactersError: there is no keyframe in that file.
        """
        self._simulation, self._session, self._logger = simulation, session, logger
        self._format = keyframe_format(simulation)
        settings = KeyframeSettings.of(values)
        self._given = read_keyframe(settings.file) if settings.file else None
        self.episode_ns = simulation.stamp_ns
        """Stamp of the first state of the episode."""
        self._publisher = KeyframePublisher(
            node,
            topics.KEYFRAME.of(node.get_name()),
            simulation.clock,
            settings,
            at_once=self._given is not None,
        )

    def go_on(self) -> None:
        """Go on from the keyframe that is given, if there is one.

        Raises:
            RecordingError: it is of another simulation.
        """
        if self._given is not None:
            snapshot, self.episode_ns = read_memory(self._given.memory, self._simulation)
            self._simulation.load_snapshot(snapshot)

    def messages(self) -> Iterator[Outgoing]:
        """The keyframe of the present state, if it has one.

        There is none of an episode's first state, which follows from the parameters; and while a
        push acts, because it was not recorded for how long it goes on.
        """
        simulation = self._simulation
        if not self._publisher.is_due(simulation.stamp_ns):
            return
        pushes = (push for each in simulation.characters for push in each.pushes)
        acting = any(push.acts_at(simulation.tick) for push in pushes)
        if acting or simulation.stamp_ns == self.episode_ns:
            return
        try:
            memory = self._format.write((simulation.snapshot(), self.episode_ns))
        except SimulationError as error:  # the run goes on without
            self._logger.log_once(f"no keyframe: {error}")
            return
        yield from self._publisher.messages(simulation.stamp_ns, self._session, memory)
