"""What a controller is asked for over topics, each message of which counts from its stamp on."""

from functools import partial
from typing import Any

from controller_node.behaviours.asked import asked_behaviour
from controller_node.controller import Controller
from controller_node.interface.publishers import ControllerPublishers
from controller_node.interface.stamped_message import decode_stamped
from controller_node.references.trajectory import points_of_lists
from controller_node.strength import strengths_of
from msgs_config.bus.node import BusNode
from msgs_config.bus.once_logger import OnceLogger
from msgs_config.bus.stamped_subscription import StampedSubscription
from msgs_config.messages import topics, typed
from msgs_config.messages.cdr import JOINT_STATE
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND


class StampedTopics:
    """Subscribes to what a controller is asked for, and publishes what was accepted.

    That is `~/joint_trajectory`, `~/strength` and `~/behaviour`; where the reference is steered,
    `cmd_vel` and `cmd_vel_stamped` as well. They are two topics: no node can subscribe to two types
    on one.
    """

    def __init__(
        self,
        node: BusNode,
        controller: Controller,
        outputs: ControllerPublishers,
        logger: OnceLogger,
    ) -> None:
        self._outputs, self._logger = outputs, logger
        self._subscribe = partial(StampedSubscription, node, rejection="refused ", logger=logger)
        self._trajectories = self._subscribe(topics.JOINT_TRAJECTORY, use=self._set_trajectory)
        self._velocities: list[StampedSubscription] = []
        self._strengths = self._subscribe(topics.STRENGTH, use=self._set_strengths)
        self._behaviours = self._subscribe(topics.BEHAVIOUR, use=self._ask)
        self._now_ns = self._episode_ns = 0
        self.use(controller, None)

    def use(self, controller: Controller, upcoming: Controller | None) -> None:
        """Ask this controller from now on, and after it that of the next episode, if another one.

        What that one is asked for is heard already: it may count from its first state on.
        """
        self._controller = controller
        is_steered = any(each and each.is_steered for each in (controller, upcoming))
        if is_steered and not self._velocities:
            self._velocities = [
                self._subscribe(topics.CMD_VEL_STAMPED, use=self._steer_stamped),
                self._subscribe(topics.CMD_VEL, use=self._steer),
            ]
        elif not is_steered:
            for each in self._velocities:
                each.close()
            self._velocities = []

    @property
    def refused(self) -> dict[str, int]:
        """Numbers of rejected messages, for the diagnostics."""
        return {
            "refused_trajectories": self._trajectories.rejected,
            **{f"refused_{each.topic}": each.rejected for each in self._velocities},
            "refused_strengths": self._strengths.rejected,
            "refused_behaviours": self._behaviours.rejected,
        }

    def take(self, state_ns: int, episode_ns: int) -> None:
        """Take the messages that came before the answer to the state of a stamp, ns.

        A message without a stamp counts from this state on, one with a stamp from its tick on. A
        wrong one is rejected whole, and what was in force goes on.
        """
        self._now_ns, self._episode_ns = state_ns, episode_ns
        self._trajectories.take()
        if self._controller.is_steered:
            for each in self._velocities:
                each.take()
        self._strengths.take()
        self._behaviours.take()

    def _set_trajectory(self, raw: bytes) -> None:
        message, start_ns = decode_stamped(raw, typed.JOINT_TRAJECTORY, "trajectory", self._now_ns)
        points = message.points
        self._controller.set_trajectory(
            points_of_lists(
                message.joint_names,
                [
                    typed.nanoseconds(point.time_from_start) / NANOSECONDS_PER_SECOND
                    for point in points
                ],
                [point.positions for point in points],
                [point.velocities for point in points],
                [point.accelerations for point in points],
            ),
            start_ns=start_ns,
            now_ns=self._now_ns,
            episode_ns=self._episode_ns,
        )
        typed.set_stamp(message, start_ns)
        self._outputs.publish_trajectory(message)

    def _steer_stamped(self, raw: bytes) -> None:
        message, start_ns = decode_stamped(raw, typed.TWIST_STAMPED, "cmd_vel", self._now_ns)
        self._take_velocity(message.twist, start_ns)

    def _steer(self, raw: bytes) -> None:
        self._take_velocity(typed.decode(raw, typed.TWIST), self._now_ns)

    def _take_velocity(self, velocity: Any, start_ns: int) -> None:
        """Steer by the parts that a character on the ground has; the others do not count."""
        clock = self._controller.clock
        start_ns = clock.stamp_ns(clock.first_tick_from(start_ns))
        linear, angular = velocity.linear, velocity.angular
        asked = (linear.x, linear.y, angular.z)
        command = self._controller.steer(
            asked, start_ns=start_ns, now_ns=self._now_ns, episode_ns=self._episode_ns
        )
        taken = (command.forward, command.left, command.turn)
        if taken != asked:
            self._logger.log_once(
                f"cmd_vel: {_listed(asked)} is more than it can, and is taken as {_listed(taken)} "
                "(m/s ahead, m/s and rad/s to the left); others beyond its limits likewise",
                kind="clamped",
            )
        self._outputs.publish_velocity(command, start_ns)

    def _set_strengths(self, raw: bytes) -> None:
        message, start_ns = decode_stamped(raw, JOINT_STATE, "strength", self._now_ns)
        layout, clock = self._controller.layout, self._controller.clock
        start_ns = clock.stamp_ns(clock.first_tick_from(start_ns))
        strengths = strengths_of(layout, tuple(message.name), tuple(message.effort), start_ns)
        self._controller.set_strengths(strengths, episode_ns=self._episode_ns)
        self._outputs.publish_strengths(strengths)

    def _ask(self, raw: bytes) -> None:
        message, start_ns = decode_stamped(raw, JOINT_STATE, "behaviour", self._now_ns)
        clock = self._controller.clock
        asked = asked_behaviour(
            tuple(message.name), clock.stamp_ns(clock.first_tick_from(start_ns))
        )
        self._controller.ask(asked, episode_ns=self._episode_ns)
        self._outputs.publish_behaviour(asked)


def _listed(velocity: tuple[float, float, float]) -> str:
    return ", ".join(f"{number:g}" for number in velocity)
