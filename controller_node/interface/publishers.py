"""The publishers of the controller, and its replies to states."""

import json
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from controller_node.actuation import net_wrench
from controller_node.behaviours.asked import AskedBehaviour
from controller_node.behaviours.base import ModeReport
from controller_node.interface.plan_message import plan_message
from controller_node.planner.outlook import Outlook
from controller_node.references.steering.velocity import VelocityCommand
from controller_node.strength import Strengths
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.bus.node import BusNode, Publisher
from msgs_config.bus.publishing import Outgoing, flush, has_subscribers, publish_together
from msgs_config.character.layout import JointLayout
from msgs_config.frame_names import WORLD
from msgs_config.messages import topics, typed
from msgs_config.messages.cdr import DoublesEncoder, encode_string
from msgs_config.messages.joint_state import JointStateEncoder
from msgs_config.messages.session import ANONYMOUS
from msgs_config.messages.state import StampedReference, StampedState
from msgs_config.runtime.throttle import Throttle

_FLUSH_TIME = 0.5  # s that subscribers may take to acknowledge messages


class Reply(NamedTuple):
    """The reply to a state; a state that comes again gets it again, without another computation."""

    raw_state: bytes
    state: StampedState
    effort: FloatArray  # (n,), of which the commanded entries are sent
    torques: bytes  # the serialised message
    session: str  # session of the simulator whose state it answers
    reference: StampedReference


class ControllerPublishers:
    """The publishers of a controller. A topic without subscribers costs nothing."""

    def __init__(
        self, node: BusNode, layout: JointLayout, commanded: IntArray, session: str | None
    ) -> None:
        """Offer the topics; `commanded` are the entries of the effort that are sent.

        `session` is the simulator's, None as long as that is not known.
        """
        self._layout = layout
        self._commanded = commanded
        self._undriven = commanded[:0]
        self.bind(session or ANONYMOUS)
        self._wrench_encoder = DoublesEncoder(WORLD)
        self._initial_states = node.publisher(topics.INITIAL_STATE)
        self._references = node.publisher(topics.REFERENCE)
        self._throttled_references = node.publisher(topics.REFERENCE_THROTTLE)
        self._throttle = Throttle()
        self._wrenches = node.publisher(topics.NET_WRENCH)
        self._torques = node.publisher(topics.JOINT_TORQUES)
        self._configurations = node.publisher(topics.CONFIGURATION)
        self._trajectories = node.publisher(topics.ACTIVE_TRAJECTORY)
        self._velocities = node.publisher(topics.ACTIVE_CMD_VEL)
        self._strengths = node.publisher(topics.ACTIVE_STRENGTH)
        self._behaviours = node.publisher(topics.ACTIVE_BEHAVIOUR)
        self._modes = node.publisher(topics.MODE)
        self._plans = node.publisher(topics.PLAN)
        self._published_mode: ModeReport | None = None
        self._published_outlook: Outlook | None = None

    def publish_initial_state(self, state: StampedState) -> None:
        """Publish in which state the reference begins; a simulator has it when this returns.

        A reset may come next, as the reference has changed.
        """
        self._initial_states.publish(
            self._reference_encoder.encode(state.stamp_ns, state.position, state.velocity)
        )
        flush((self._initial_states,), _FLUSH_TIME)

    def bind(self, session: str) -> None:
        """Name the simulator's session in what answers its states."""
        names = self._layout.dof_names
        self._session = session
        self._torque_encoder = JointStateEncoder(
            [names[entry] for entry in self._commanded], session
        )
        self._reference_encoder = JointStateEncoder(names, session)

    def drive(self, entries: IntArray) -> None:
        """Command nothing to the commanded entries that are not among these, from now on."""
        self._undriven = np.setdiff1d(self._commanded, entries)

    @property
    def torque_subscribers(self) -> int:
        """How many subscribe to the torques."""
        return self._torques.get_subscription_count()

    def make_reply(
        self, raw: bytes, state: StampedState, effort: FloatArray, reference: StampedReference
    ) -> Reply:
        """The reply with an effort (n,) to a state, ready to be published."""
        if len(self._undriven):
            effort = effort.copy()
            effort[self._undriven] = 0.0
        torques = self._torque_encoder.encode(state.stamp_ns, effort=effort[self._commanded])
        return Reply(raw, state, effort, torques, self._session, reference)

    def publish(self, reply: Reply) -> None:
        """Publish a reply, the torques first: the simulator goes on while the rest is made."""
        publish_together([(self._torques, reply.torques)])
        publish_together(self._beside_torques(reply))

    def make_up(self, reply: Reply | None) -> None:
        """Publish the last reply's reference on the throttled topic, too, if no other follows."""
        if reply is not None and self._throttle.makes_up():
            publish_together(self._reference(self._throttled_references, reply.reference))

    def _beside_torques(self, reply: Reply) -> Iterator[Outgoing]:
        """The messages that the simulator does not wait for, where there are subscribers."""
        yield from self._reference(self._references, reply.reference)
        if self._throttle.chooses():
            yield from self._reference(self._throttled_references, reply.reference)
        if has_subscribers(self._wrenches):
            yield self._wrenches, self._net_wrench(reply)

    def _reference(self, publisher: Publisher, reference: StampedReference) -> Iterator[Outgoing]:
        if has_subscribers(publisher):
            arrays = reference.position, reference.velocity
            yield publisher, self._reference_encoder.encode(reference.stamp_ns, *arrays)

    def flush(self) -> None:
        """Wait a while until every subscriber has what was published in answer to states."""
        flush((self._torques, self._references, self._wrenches), _FLUSH_TIME)

    def publish_configuration(self, text: str) -> None:
        """Publish what the controller is and has in force, as JSON."""
        self._configurations.publish(encode_string(text))

    def publish_trajectory(self, trajectory: Any) -> None:
        """Publish a `JointTrajectory` that was taken, with the stamp that it begins at."""
        self._trajectories.publish(typed.encode(trajectory))

    def publish_velocity(self, command: VelocityCommand, start_ns: int) -> None:
        """Publish a velocity as it was taken, with the stamp that it begins at."""
        message = typed.stamped(typed.TWIST_STAMPED, start_ns)
        message.twist.linear.x, message.twist.linear.y = command.forward, command.left
        message.twist.angular.z = command.turn
        self._velocities.publish(typed.encode(message))

    def publish_strengths(self, strengths: Strengths) -> None:
        """Publish strengths that were taken, of every joint, with the stamp that they begin at."""
        values = strengths.by_joint(self._layout)
        encoder = JointStateEncoder(list(values), "")
        effort = np.array(list(values.values()))
        self._strengths.publish(encoder.encode(strengths.start_ns, effort=effort))

    def publish_behaviour(self, asked: AskedBehaviour) -> None:
        """Publish what was asked of the behaviour, with the stamp that it begins at."""
        encoder = JointStateEncoder([asked.ask.value], "")
        self._behaviours.publish(encoder.encode(asked.start_ns))

    def begin_episode(self) -> None:
        """Publish the next mode even where it is the one of before."""
        self._published_mode = None

    def publish_changes(
        self, mode: ModeReport | None, outlook: Outlook | None, stamp_ns: int
    ) -> None:
        """Publish the mode as JSON, and the expectation of a plan, where they are new.

        The mode's report tells since when and why it holds; `stamp_ns` is that of the state in
        which the plan was made.
        """
        # A plan in force has one outlook object: another one is that of a new plan.
        if outlook is not None and outlook is not self._published_outlook:
            self._published_outlook = outlook
            if has_subscribers(self._plans):
                self._plans.publish(plan_message(outlook, stamp_ns))
        if mode is not None and mode is not self._published_mode:
            self._published_mode = mode
            self._modes.publish(encode_string(json.dumps(mode.content(), allow_nan=False)))

    def _net_wrench(self, reply: Reply) -> bytes:
        """The serialised message."""
        sent = np.zeros(self._layout.size)
        sent[self._commanded] = reply.effort[self._commanded]
        force, torque = net_wrench(self._layout, reply.state.position, sent)
        return self._wrench_encoder.encode(reply.state.stamp_ns, np.array(force + torque))
