"""The publishers of a character's sensors, for controllers that know no more than a robot does."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from msgs_config.bus.node import BusNode, Publisher
from msgs_config.bus.publishing import Outgoing, has_subscribers
from msgs_config.character.sensors import SensorType
from msgs_config.messages import topics
from msgs_config.messages.cdr import DoublesEncoder
from sim_node.node_settings import NodeSettings, SensingSettings
from sim_node.physics.simulated_character import SimulatedCharacter
from sim_node.sensors.readers import SensorReader, make_readers

_NO_WRENCH = np.zeros(6)


class _SensorPublisher(NamedTuple):
    """One sensor's reader and publisher."""

    reader: SensorReader
    publisher: Publisher
    encoder: DoublesEncoder
    reads_contacts: bool


class SensorPublishers:
    """Publishes the readings of the sensors that have subscribers; nothing is read for others."""

    def __init__(
        self, node: BusNode, character: SimulatedCharacter, settings: NodeSettings
    ) -> None:
        """Offer a topic for each sensor, below the character's name."""
        self._character, self._clock = character, settings.clock
        self.wants_contacts = False
        """Whether a force sensor had subscribers when the readings were published last."""
        self._sensors = []
        for sensor, reader in make_readers(character, settings.sensing):
            topic = topics.sensor_reading(sensor.type, sensor.topic).under(character.setup.name)
            self._sensors.append(
                _SensorPublisher(
                    reader,
                    node.publisher(topic),
                    DoublesEncoder(character.setup.prefix + sensor.name),
                    sensor.type is SensorType.FORCE,
                )
            )

    def change(self, settings: SensingSettings) -> None:
        """Read by other settings from now on."""
        readers = [reader for _, reader in make_readers(self._character, settings)]
        self._sensors = [
            each._replace(reader=reader)
            for each, reader in zip(self._sensors, readers, strict=True)
        ]

    def messages(self) -> Iterator[Outgoing]:
        """The readings of a tick, which are the same whenever they are asked for.

        A force whose sensor had no subscribers during the tick is not known, and zero.
        """
        stamp_ns = self._character.state.stamp_ns
        self.wants_contacts = False
        for reader, publisher, encoder, reads_contacts in self._sensors:
            if has_subscribers(publisher):
                self.wants_contacts |= reads_contacts
                values = reader.read(self._clock.tick(stamp_ns))
                yield publisher, encoder.encode(stamp_ns, _NO_WRENCH if values is None else values)

    @property
    def publishers(self) -> list[Publisher]:
        """The publishers of all sensors."""
        return [each.publisher for each in self._sensors]
