"""The behaviour `onnx`, for one episode: a network's answers as targets of joints."""

from dataclasses import dataclass

import numpy as np

from controller_node.behaviours.base import BehaviourOutput, Mode, Observation, Phase
from controller_node.behaviours.onnx_policy.check import initial_state
from controller_node.behaviours.onnx_policy.description import Description
from controller_node.behaviours.onnx_policy.motion import (
    Placement,
    Pose,
    TrackedMotion,
    motion_of,
)
from controller_node.behaviours.onnx_policy.observation import ObservationHistory, frame_of
from controller_node.behaviours.onnx_policy.session import STEP_INPUT, Network
from controller_node.behaviours.onnx_policy.terms import Situation
from controller_node.control_laws import GainArrays, scale_gains
from controller_node.references.base import ReferenceState
from controller_node.references.transformed import PlanarTransform
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import GeneralizedPosition, JointLayout
from msgs_config.errors import SimulationError


@dataclass(frozen=True, eq=False)
class PolicyKit:
    """What a policy works with; the same for all episodes."""

    network: Network
    policy: Description
    layout: JointLayout
    entries: IntArray  # (m,) of its joints, in its order
    hold: int  # ticks of a decision
    rate_hz: int
    model: DynamicsModel | None = None  # says where the anchor is, where there is one
    anchor: int = 0  # row of its link

    @property
    def plays_motion(self) -> bool:
        """Whether the motion that it tracks is in the network itself."""
        return self.policy.needs_motion and STEP_INPUT in self.network.inputs

    def anchor_at(self, position: FloatArray) -> Pose | None:
        """Where the anchor of a character at a position (n,) is; None without one."""
        if self.model is None:
            return None
        self.model.update(position, np.zeros(len(position)))
        places, turns = self.model.link_poses()
        return Pose(places[self.anchor], turns[self.anchor])


class JointTargets:
    """The targets of the decision in force; all other entries are the reference's."""

    clip = ""

    def __init__(self, entries: IntArray, targets: FloatArray) -> None:
        self._entries = entries
        self.targets = targets  # (m,) rad or m

    def state_at(self, time: float, own: ReferenceState) -> ReferenceState:
        """The targets at rest, at whatever time."""
        position, velocity, acceleration = (
            each.copy() for each in (own.configuration.position, own.velocity, own.acceleration)
        )
        position[self._entries] = self.targets
        velocity[self._entries] = acceleration[self._entries] = 0.0
        configuration = GeneralizedPosition(position, own.configuration.orientations_xyzw)
        return ReferenceState(configuration, velocity, acceleration)


class OnnxPolicy:
    """Decides every few ticks; between, its targets hold.

    It remembers the last action, the frames of its history, what a recurrent network hands on, and
    when it decided.
    """

    def __init__(self, kit: PolicyKit) -> None:
        self._kit = kit
        self.carry = PlanarTransform()
        policy = kit.policy
        self._decided: int | None = None  # tick of the last decision
        self._count = 0  # decisions
        self._history = ObservationHistory(policy.terms, policy.history)
        self._action = np.zeros(len(policy.joints))
        self._state = initial_state(kit.network, policy)
        self._place: Placement | None = None  # of the motion in the network
        self._target = JointTargets(kit.entries, policy.action_offset)
        self._gains: tuple[GainArrays, FloatArray, GainArrays] | None = None
        self._phase = Phase(Mode.TRACK, {"assistance": "none", "policy": kit.network.path.name})

    def advance(self, seen: Observation) -> BehaviourOutput:
        """The targets and gains of a tick, in whose first one of each few it decides."""
        tick, hold = round(seen.time * self._kit.rate_hz), self._kit.hold
        if self._decided is None or tick // hold != self._decided // hold:
            self._decide(seen)
            self._decided = tick
        return BehaviourOutput(self._phase, self._target, self._gains_of(seen))

    def _decide(self, seen: Observation) -> None:
        policy, network = self._kit.policy, self._kit.network
        if STEP_INPUT in self._state:
            self._state[STEP_INPUT] = np.full_like(self._state[STEP_INPUT], self._count)
        observation = self._history.add(frame_of(policy.terms, self._situation(seen)))
        answer, outputs = network.evaluate(observation, self._state)
        if not np.isfinite(answer).all():
            joint = policy.joints[int(np.flatnonzero(~np.isfinite(answer))[0])]
            raise SimulationError(
                f"{network.path}: its action for '{joint}' is not finite {seen.time:g} s after "
                "the first state"
            )
        for name, output in policy.recurrent.items():
            self._state[name] = outputs[output]
        action = answer.astype(float)
        if policy.action_clip is not None:
            action = np.clip(action, *policy.action_clip)
        targets = policy.action_offset + policy.action_scale * action
        if policy.target_clip is not None:
            targets = np.clip(targets, policy.target_clip[:, 0], policy.target_clip[:, 1])
        self._action, self._target.targets = action, targets
        self._count += 1

    def _situation(self, seen: Observation) -> Situation:
        course, anchor = seen.course, self._kit.anchor_at(seen.position)
        command = (0.0, 0.0, 0.0) if course is None else (course.forward, course.left, course.turn)
        return Situation(
            time=seen.time,
            position=seen.position,
            velocity=seen.velocity,
            entries=self._kit.entries,
            default=self._kit.policy.default,
            last_action=self._action,
            command=command,
            motion=self._motion(seen, anchor),
            anchor=anchor,
        )

    def _motion(self, seen: Observation, anchor: Pose | None) -> TrackedMotion:
        """The reference's; or the network's, which begins where the character is, and faces."""
        kit = self._kit
        if not kit.plays_motion:
            position = seen.now.configuration.position
            joints = position[kit.entries], seen.now.velocity[kit.entries]
            return TrackedMotion(*joints, kit.anchor_at(position))
        # What it says of its motion does not depend on the observation.
        _, outputs = kit.network.evaluate(np.zeros(kit.policy.size, np.float32), self._state)
        motion = motion_of(outputs, kit.policy.motion_body)
        if anchor is None or motion.anchor is None:
            return motion
        if self._place is None:
            self._place = Placement.leading(motion.anchor, anchor)
        return motion._replace(anchor=self._place.moved(motion.anchor))

    def _gains_of(self, seen: Observation) -> GainArrays:
        """The policy's own gains at the strengths in force, made where these change."""
        whole, strengths = seen.whole_gains, seen.strengths
        known = self._gains
        if known is None or known[0] is not whole or known[1] is not strengths:
            stiffness, damping = whole.stiffness.copy(), whole.damping.copy()
            stiffness[self._kit.entries] = self._kit.policy.stiffness
            damping[self._kit.entries] = self._kit.policy.damping
            own = GainArrays(stiffness, damping, whole.integral, whole.effort_limits)
            known = whole, strengths, scale_gains(self._kit.layout, own, strengths)
            self._gains = known
        return known[2]
