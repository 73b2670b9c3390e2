"""The behaviour `state_machine`, for one episode."""

from dataclasses import dataclass, replace

import numpy as np

from controller_node.behaviours.base import BehaviourOutput, Mode, Observation, Phase
from controller_node.behaviours.state_machine.body import BodyReader
from controller_node.behaviours.state_machine.description import (
    REACH,
    STANCE,
    STEP,
    SWING,
    Condition,
    Machine,
    State,
)
from controller_node.behaviours.state_machine.effort_maker import EffortMaker, Hold
from controller_node.behaviours.state_machine.laws import smooth_step
from controller_node.behaviours.state_machine.legs.footing import (
    ReachingFoot,
    SwingFoot,
    contacts_of,
    landing,
    origin_of,
)
from controller_node.behaviours.state_machine.legs.leg import Leg
from controller_node.behaviours.state_machine.pose import PoseMaker, TargetPose
from controller_node.behaviours.state_machine.situation import Situation, quantity, situation_of
from controller_node.behaviours.state_machine.support import FootContact
from controller_node.control_laws import GainArrays
from controller_node.references.base import ReferenceState
from controller_node.references.steering.course import Course
from controller_node.references.steering.velocity import within
from controller_node.references.transformed import PlanarTransform
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointLayout
from msgs_config.geometry.scalars import Vector

_STANDING_COURSE = Course()


@dataclass(frozen=True, eq=False)
class MachineKit:
    """What a machine works with; the same for all episodes."""

    machine: Machine
    layout: JointLayout
    legs: dict[str, Leg]  # by side
    reader: BodyReader
    poses: PoseMaker
    efforts: EffortMaker
    gravity: float  # m/s^2
    period: float  # s


class PoseTarget:
    """The targets of the present tick, which hold until its end."""

    clip = ""

    def __init__(self, layout: JointLayout) -> None:
        self._layout = layout
        self._still = np.zeros(layout.size)
        # Its owner keeps the pose up to date.
        self.pose = TargetPose(self._still, self._still, self._still)

    def state_at(self, time: float, own: ReferenceState) -> ReferenceState:
        """The targets, at whatever time."""
        position = self._layout.configuration(self.pose.position)
        return ReferenceState(position, self.pose.velocity, self._still)


class StateMachine:
    """The states of a machine one after another, as they end.

    The roots of its errors are none: nothing commands the root.
    """

    def __init__(self, kit: MachineKit) -> None:
        self._kit = kit
        self.carry = PlanarTransform()
        sides = list(kit.machine.sides)
        self._stance, self._swing = sides[0], sides[1]
        self._state = kit.machine.states[kit.machine.start]
        self._since = 0.0  # s, time at which the state began
        self._entered = False
        self._course = _STANDING_COURSE
        self._feet: dict[str, SwingFoot] = {}  # by role
        self._reaching: dict[str, ReachingFoot] = {}  # by role
        self._goal: tuple[float, float] | None = None  # m, where a foot that steps lands
        self._target = PoseTarget(kit.layout)
        self._last: tuple[FloatArray, float] | None = None  # targets and height of the last tick
        self._none = np.zeros(kit.layout.size)

    def advance(self, seen: Observation) -> BehaviourOutput:
        """The targets and efforts of a tick; the state before them may end first."""
        kit = self._kit
        self._course = self._followed(seen.course or _STANDING_COURSE)
        body = kit.reader.read(seen.position, seen.velocity, seen.contacts)
        at = situation_of(body, self._course, self._stance, self._swing, kit.gravity)
        if not self._entered:
            self._enter(self._state, seen.time, at)
        at = self._go_on(seen.time, at)
        time = seen.time - self._since
        contacts = contacts_of(self._state, at, time, kit.legs)
        pose = self._pose(at, time, contacts)
        gains = kit.efforts.gains(self._state, self._stance, seen.gains)
        height = self._height(at, time)
        if self._state.tracks:
            effort = kit.efforts.balanced(self._state, at, pose, gains)
        else:
            root = replace(self._state.root, height=height)
            hold = Hold(root, self._ground(at), root.arrival * self._state.duration - time)
            effort = kit.efforts.supported(self._state, at, pose, gains, contacts, hold)
            gains = GainArrays(self._none, self._none, self._none, seen.gains.effort_limits)
        self._target.pose, self._last = pose, (pose.position, height)
        return BehaviourOutput(self._phase, self._target, gains, effort)

    def _followed(self, course: Course) -> Course:
        """A course whose velocity is taken over as fast as the machine can."""
        before, most = self._course, self._kit.machine.acceleration * self._kit.period
        return replace(
            course,
            forward=before.forward + within(course.forward - before.forward, most),
            left=before.left + within(course.left - before.left, most),
        )

    def _go_on(self, now: float, at: Situation) -> Situation:
        """Go over to the next state if the present one ends: once a tick at most."""
        kit, time = self._kit, now - self._since

        def holds(condition: Condition) -> bool:
            return condition.holds(quantity(condition.quantity, at, self._state, time, kit.legs))

        for end in self._state.ends:
            if all(map(holds, end.conditions)):
                if end.swap:
                    self._stance, self._swing = self._swing, self._stance
                    at = situation_of(at.body, at.course, self._stance, self._swing, kit.gravity)
                self._enter(kit.machine.states[end.then], now, at)
                break
        return at

    def _enter(self, state: State, now: float, at: Situation) -> None:
        self._state, self._since, self._entered = state, now, True
        # The targets and the height that a blend comes over from.
        self._before = self._last or (at.body.position, at.body.root[2] - self._ground(at))
        sides = {STANCE: self._stance, SWING: self._swing}
        self._feet, self._goal = {}, None
        for role, side in sides.items():
            if state.feet[role] == STEP:
                self._feet[role] = SwingFoot.leaving(at.foot(side))
            elif state.feet[role] == REACH:
                leg = self._kit.legs[side]
                origin = origin_of(state.placement, at, leg)
                self._reaching[role] = ReachingFoot.leaving(at.foot(side), origin)
        facts = {"assistance": "none", "state": state.name, "stance": self._stance}
        self._phase = Phase(Mode.STATE, facts)

    def _ground(self, at: Situation) -> float:
        """Height of the soles that stand, or of both where none does, m."""
        sides = [self._stance if role == STANCE else self._swing for role in self._state.standing]
        soles = [at.foot(side).sole[2] for side in sides or at.body.feet]
        return 0.5 * (soles[0] + soles[-1])

    def _height(self, at: Situation, time: float) -> float:
        """Height of the root above the ground, m: as wanted, or as it is in a state that tracks."""
        state = self._state
        if state.tracks:
            return at.body.root[2] - self._ground(at)
        share = smooth_step(time / state.blend) if 0.0 <= time < state.blend else 1.0
        start = self._before[1]
        return start + share * (state.root.height - start)

    def _pose(self, at: Situation, time: float, contacts: list[FootContact]) -> TargetPose:
        """The targets of all joints."""
        kit, state = self._kit, self._state
        pose = kit.poses.free(state, at)
        if 0.0 <= time < state.blend:  # an earlier state than the last one may be asked about
            share = smooth_step(time / state.blend)
            pose.position = kit.poses.between(self._before[0], pose.position, share)
            pose.position[:6] = at.body.position[:6]
        pressure = self._pressure(at, contacts)
        laters = (0.0, kit.period, 2.0 * kit.period)
        for role, side in ((STANCE, self._stance), (SWING, self._swing)):
            doing = state.feet[role]
            if role in state.standing:
                kit.poses.follow_leg(pose, side, at.body)
            elif doing == STEP:
                goal = landing(state, at, time, pressure)
                if self._goal is not None and time >= state.placement.fixed * state.duration:
                    goal = (self._goal[0], goal[1])
                self._goal = goal
                foot = self._feet[role]
                poses = [foot.pose(state, at, time + later, goal) for later in laters]
                kit.poses.set_leg(pose, side, at.body, poses)
            elif doing == REACH:
                origin = origin_of(state.placement, at, kit.legs[side])
                reaching = self._reaching[role]
                poses = [reaching.pose(state, at, time, origin, later) for later in laters]
                kit.poses.set_leg(pose, side, at.body, poses)
        return pose

    def _pressure(self, at: Situation, contacts: list[FootContact]) -> Vector:
        """The centre of pressure, from the stance sole; without one that sole itself."""
        if len(contacts) != 1:
            return (0.0, 0.0, 0.0)
        return at.local(contacts[0].pressure)
