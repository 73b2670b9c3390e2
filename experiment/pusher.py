"""`pusher`: sends pushes that were planned before a run, each stamped for its tick."""

from pathlib import Path

from rclpy.duration import Duration
from rclpy.node import Node

from experiment.planned_push import read_pushes
from msgs_config import topics
from msgs_config.node_parameters import declare, given_parameters
from msgs_config.parameters import Parameter, resolve
from msgs_config.polling import DirectSubscription, Spinner
from msgs_config.process import StopSignal
from msgs_config.wrench_messages import encode_wrenches

PARAMETERS = [
    Parameter("file", "pushes.json", "the pushes, as a run writes them"),
    Parameter(
        "wait_for_subscribers", 1, "send when this many subscribe to external_wrench", maximum=1000
    ),
]

_PATIENCE = Duration(seconds=10)  # until the simulator has what was sent


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
        self._pushes = read_pushes(Path(values.text("file")))
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
                    self._publisher.wait_for_all_acked(_PATIENCE)
                    self._torques = DirectSubscription(self, topics.JOINT_TORQUES)
                if self._torques is None or self._torques.take() is None:
                    spinner.rest()
                else:
                    spinner.received()
        finally:
            spinner.close()
