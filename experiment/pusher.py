"""`pusher`: sends pushes that were planned before a run, each stamped for its tick."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from rclpy.node import Node

from msgs_config import topics
from msgs_config.errors import RecordingError
from msgs_config.node_parameters import declare, given_parameters
from msgs_config.parameters import Parameter, resolve
from msgs_config.polling import DirectSubscription, Spinner
from msgs_config.process import StopSignal
from msgs_config.wrench_messages import WrenchArrays, encode_wrenches

PARAMETERS = [
    Parameter("file", "pushes.json", "the pushes, as a run writes them"),
    Parameter(
        "wait_for_subscribers", 1, "send when this many subscribe to external_wrench", maximum=1000
    ),
]


@dataclass(frozen=True)
class PlannedPush:
    """A force and a torque on a link from a stamp on, for the simulator's `wrench_duration`."""

    stamp_ns: int
    link: str
    wrench: tuple[float, ...]  # (6,): force N, torque N m; world axes
    point: tuple[float, float, float] | None = None  # m, link frame; None: the centre of mass

    def arrays(self) -> WrenchArrays:
        """The push as a message's content."""
        points = [] if self.point is None else [self.point]
        return WrenchArrays.of_rows(self.stamp_ns, [self.link], [self.wrench], points)


def write_pushes(file: Path, pushes: Sequence[PlannedPush]) -> None:
    """Write pushes for the node to send."""
    file.write_text(json.dumps([asdict(push) for push in pushes], indent=1), encoding="utf-8")


class PusherNode(Node):
    """Sends its pushes, and only then subscribes to the torques.

    A controller that waits for that subscription answers no state before all pushes are there.
    """

    def __init__(self) -> None:
        """Read the pushes.

        Raises:
            ActuatedCharactersError: a parameter is wrong, or the file cannot be read.
        """
        super().__init__("pusher")
        values = resolve(PARAMETERS, given_parameters(self))
        declare(self, PARAMETERS, values)
        self._wanted = values.integer("wait_for_subscribers")
        file = Path(values.text("file"))
        try:
            self._pushes = [PlannedPush(**push) for push in json.loads(file.read_text("utf-8"))]
        except (OSError, ValueError, TypeError) as error:
            raise RecordingError(f"{file} holds no pushes: {error}") from error
        self._publisher = topics.create_publisher(self, topics.EXTERNAL_WRENCH)
        self._torques: DirectSubscription | None = None

    def run(self, stop: StopSignal) -> None:
        """Send as soon as they are heard, then be there until `stop`."""
        spinner = Spinner(self)
        try:
            while not stop:
                heard = self._publisher.get_subscription_count() >= self._wanted
                if self._torques is None and heard:
                    for push in self._pushes:
                        self._publisher.publish(encode_wrenches(push.arrays()))
                    self._torques = DirectSubscription(self, topics.JOINT_TORQUES)
                if self._torques is None or self._torques.take() is None:
                    spinner.rest()
                else:
                    spinner.received()
        finally:
            spinner.close()
