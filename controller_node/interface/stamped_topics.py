"""What a controller is asked for over topics, each message of which counts from its stamp on."""

from functools import partial
from typing import Any

import numpy as np

from controller_node.behaviours.asked import asked_behaviour
from controller_node.controller import Controller
from controller_node.interface.publishers import ControllerPublishers
from controller_node.interface.stamped_message import checked_start, decode_stamped
from controller_node.interface.trajectory_goals import TrajectoryGoals
from controller_node.references.trajectory import points_of_lists
from controller_node.strength import strengths_of
from msgs_config.bus.node import BusNode
from msgs_config.bus.once_logger import OnceLogger
from msgs_config.bus.stamped_subscription import StampedSubscription
from msgs_config.messages import topics, typed
from msgs_config.messages.cdr import JOINT_STATE
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.state import StampedReference, StampedState

_POINT = "trajectory_msgs/msg/JointTrajectoryPoint"
_DURATION = "builtin_interfaces/msg/Duration"
_LISTS = ("positions", "velocities", "accelerations", "effort")
_STOP_TIME_NS = NANOSECONDS_PER_SECOND // 5


class StampedTopics:
    """Subscribes to what a controller is asked for, and publishes what was accepted.

    That is `~/joint_trajectory`, `~/strength` and `~/behaviour`; where the reference is steered,
    `cmd_vel` and `cmd_vel_stamped` as well. They are two topics: no node can subscribe to two types
    on one. Beside them stands the action `~/follow_joint_trajectory`, where its package is.
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
        self._goals = TrajectoryGoals(node, controller.layout, self._accept, self._stop)
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

    def judge(self, state: StampedState, reference: StampedReference) -> None:
        """Judge the goal of an action by a state that was answered, and its reference."""
        self._goals.judge(state, reference)

    def begin_episode(self) -> None:
        """End what does not outlive an episode."""
        self._goals.begin_episode()

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
        self._goals.take()
        if self._controller.is_steered:
            for each in self._velocities:
                each.take()
        self._strengths.take()
        self._behaviours.take()

    def _set_trajectory(self, raw: bytes) -> None:
        message, start_ns = decode_stamped(raw, typed.JOINT_TRAJECTORY, "trajectory", self._now_ns)
        self._track(message, start_ns)
        self._goals.replaced()
        typed.set_stamp(message, start_ns)
        self._outputs.publish_trajectory(message)

    def _accept(self, trajectory: Any) -> int:
        """Track the trajectory of an action's goal; the stamp of its start, ns."""
        start_ns = checked_start(trajectory.header.stamp, "trajectory", self._now_ns)
        self._track(trajectory, start_ns)
        message = _as_typed(trajectory)
        typed.set_stamp(message, start_ns)
        self._outputs.publish_trajectory(message)
        return start_ns

    def _stop(self, names: tuple[str, ...]) -> None:
        """Bring everything to rest where it is wanted now: the goal of an action is cancelled."""
        where = self._controller.wanted_position(self._now_ns)
        point = typed.new(
            _POINT,
            positions=where[self._controller.layout.indices(names)],
            time_from_start=typed.new(_DURATION, nanosec=_STOP_TIME_NS),
        )
        self._accept(typed.new(typed.JOINT_TRAJECTORY, joint_names=list(names), points=[point]))

    def _track(self, message: Any, start_ns: int) -> None:
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


def _as_typed(trajectory: Any) -> Any:
    """A trajectory of whatever class, as one that can be serialised here."""
    points = [
        typed.new(
            _POINT,
            **{name: np.array(getattr(each, name), dtype=float) for name in _LISTS},
            time_from_start=typed.new(
                _DURATION, sec=each.time_from_start.sec, nanosec=each.time_from_start.nanosec
            ),
        )
        for each in trajectory.points
    ]
    names = list(trajectory.joint_names)
    return typed.new(typed.JOINT_TRAJECTORY, joint_names=names, points=points)


def _listed(velocity: tuple[float, float, float]) -> str:
    return ", ".join(f"{number:g}" for number in velocity)
