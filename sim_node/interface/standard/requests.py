"""What each service of `simulation_interfaces` does. No ROS in here: messages are any objects.

A request is refused by a `RefusedRequestError`, whose code and sentence are the result; else it is
OK.
"""

from collections.abc import Callable, Mapping
from functools import partial
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

from msgs_config.bus.node import Answer, BusNode, Goal
from msgs_config.errors import CommandError
from msgs_config.frame_names import WORLD
from msgs_config.geometry import fixed_order, rotations
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.shared_parameters import NO_GROUND, PLANE
from sim_node.initial_state import POSITION, VELOCITY
from sim_node.interface.services import Services
from sim_node.interface.standard.codes import (
    INVALID_ENTITY_POSE,
    PACKAGE,
    Code,
    Feature,
    RefusedRequestError,
    Scope,
    SpawnCode,
    State,
    StateCode,
    WorldCode,
)
from sim_node.interface.standard.entities import Entities
from sim_node.interface.standard.spawning import requested_throw, resource_of
from sim_node.physics.simulation import Simulation
from sim_node.timing.run_control import RunControl

_MOST_STEPS = 1_000_000_000
_WHOLE_RESETS = (Scope.DEFAULT, Scope.ALL, Scope.STATE | Scope.SPAWNED)


class Operations(NamedTuple):
    """What the simulator lets these services do."""

    services: Services
    control: RunControl
    simulation: Simulation
    entities: Entities
    terrain: str  # the parameter of this name
    begin_with: Callable[[Mapping[str, list[float]]], str]
    """Changes parameters of the start, and begins a new episode; why not, empty if so."""


class StandardServices:
    """Does what is asked for by the services of `simulation_interfaces`."""

    def __init__(self, operations: Operations) -> None:
        self._own = operations
        self._stopped_tick: int | None = None  # at which it was stopped
        self._goal: tuple[Goal, int, int] | None = None  # with the steps in all, and its last tick

    def offer(self, node: BusNode) -> None:
        """Offer all of them."""
        for name, (kind, act) in self._services().items():
            node.offer_typed(name, f"{PACKAGE}/srv/{kind}", partial(_fill, act))
        node.offer_action("simulate_steps", f"{PACKAGE}/action/SimulateSteps", self.simulate_steps)

    def _services(self) -> dict[str, tuple[str, Callable[[Any, Any], Answer | None]]]:
        return {
            "get_simulator_features": ("GetSimulatorFeatures", self.get_features),
            "reset_simulation": ("ResetSimulation", self.reset),
            "get_simulation_state": ("GetSimulationState", self.get_state),
            "set_simulation_state": ("SetSimulationState", self.set_state),
            "step_simulation": ("StepSimulation", self.step),
            "get_entities": ("GetEntities", self.get_entities),
            "get_entity_state": ("GetEntityState", self.get_entity_state),
            "set_entity_state": ("SetEntityState", self.set_entity_state),
            "spawn_entity": ("SpawnEntity", self.spawn),
            "load_world": ("LoadWorld", self.load_world),
        }

    @property
    def state(self) -> State:
        """Playing, paused, or stopped: paused by a stop, and no tick since."""
        if not self._own.control.paused or self._own.control.steps_left:
            return State.PLAYING
        stopped = self._stopped_tick == self._own.simulation.tick
        return State.STOPPED if stopped else State.PAUSED

    def get_features(self, request: Any, response: Any) -> None:
        """GetSimulatorFeatures."""
        del request
        response.features.features = [int(each) for each in Feature]
        response.features.spawn_formats = ["urdf"]
        response.features.custom_info = (
            "a URDF to spawn has one link with a box or sphere; uris are ball and box"
        )

    def reset(self, request: Any, response: Any) -> None:
        """ResetSimulation: a new episode in a fresh world. Time goes on in any case."""
        del response
        if request.scope not in _WHOLE_RESETS:
            raise RefusedRequestError(
                Code.FEATURE_UNSUPPORTED,
                f"the scope is {request.scope}; state and spawned entities are reset together, and "
                "time never is: it must be 0, 6 or 255",
            )
        self._own.services.reset()

    def get_state(self, request: Any, response: Any) -> None:
        """GetSimulationState."""
        del request
        response.state.state = int(self.state)

    def set_state(self, request: Any, response: Any) -> None:
        """SetSimulationState."""
        del response
        wanted, now = request.state.state, self.state
        if wanted == now:
            raise RefusedRequestError(
                StateCode.ALREADY_IN_TARGET_STATE, f"it is {now.name} already"
            )
        if wanted == State.PLAYING:
            self._stopped_tick = None
            try:
                self._own.services.resume()
            except CommandError as error:
                raise RefusedRequestError(StateCode.STATE_TRANSITION_ERROR, str(error)) from error
        elif wanted == State.PAUSED:
            self._stopped_tick = None
            self._own.services.pause()
        elif wanted == State.STOPPED:
            self._stop()
        elif wanted == State.QUITTING:
            self._own.control.quits = True
        else:
            raise RefusedRequestError(
                StateCode.INCORRECT_TRANSITION,
                f"the state is {wanted}; it must be 0 (stopped), 1 (playing), 2 (paused) or 3 "
                "(quitting)",
            )

    def _stop(self) -> None:
        self._own.services.pause()
        self._own.services.reset()
        self._stopped_tick = self._own.simulation.tick

    def step(self, request: Any, response: Any) -> Answer:
        """StepSimulation; answers when the steps are done."""
        steps = self._begin_steps(int(request.steps))
        answer = Answer()

        def finish() -> None:
            _write(response, Code.OK if steps.success else Code.OPERATION_FAILED, steps.message)
            answer.give(True)

        steps.when_given(finish)
        return answer

    def _begin_steps(self, count: int) -> Answer:
        if not 1 <= count <= _MOST_STEPS:
            raise RefusedRequestError(
                Code.OPERATION_FAILED, f"'steps' is {count}; it must be 1 to {_MOST_STEPS}"
            )
        if self.state is not State.PAUSED:
            raise RefusedRequestError(
                Code.OPERATION_FAILED, f"it is {self.state.name}; it must be paused"
            )
        try:
            return self._own.services.step(count)
        except CommandError as error:
            raise RefusedRequestError(Code.OPERATION_FAILED, str(error)) from error

    def simulate_steps(self, goal: Goal) -> Answer:
        """SimulateSteps: the same, with feedback after each tick, until it is cancelled."""
        count, answer = int(goal.request.steps), Answer()
        last = self._own.simulation.tick + count
        try:
            steps = self._begin_steps(count)
        except RefusedRequestError as refusal:
            _write(goal.result, refusal.code, str(refusal))
            return Answer(False, str(refusal))
        self._goal = goal, count, last

        def finish() -> None:
            self._tell_progress()
            self._goal = None
            code = Code.OK if steps.success else Code.OPERATION_FAILED
            _write(goal.result, code, steps.message)
            answer.give(steps.success)

        steps.when_given(finish)
        return answer

    def after_tick(self) -> None:
        """Tell how far the steps of an action are, or end them if they are not wanted any more."""
        if self._goal is None:
            return
        if self._goal[0].is_cancelled:
            self._own.services.pause()
        else:
            self._tell_progress()

    def _tell_progress(self) -> None:
        assert self._goal is not None
        goal, count, last = self._goal
        feedback, left = goal.feedback, max(last - self._own.simulation.tick, 0)
        feedback.completed_steps, feedback.remaining_steps = count - left, left
        goal.publish(feedback)

    def get_entities(self, request: Any, response: Any) -> None:
        """GetEntities."""
        response.entities = self._own.entities.names(request.filters)

    def get_entity_state(self, request: Any, response: Any) -> None:
        """GetEntityState."""
        motion, state = self._own.entities.motion(request.entity), response.state
        header, pose = state.header, state.pose
        header.stamp.sec, header.stamp.nanosec = divmod(
            self._own.simulation.stamp_ns, NANOSECONDS_PER_SECOND
        )
        header.frame_id = WORLD
        for message, numbers in (
            (pose.position, motion.position),
            (pose.orientation, motion.orientation_xyzw),
            (state.twist.linear, motion.linear),
            (state.twist.angular, motion.angular),
        ):
            for name, number in zip("xyzw", numbers.tolist(), strict=False):
                setattr(message, name, number)

    def set_entity_state(self, request: Any, response: Any) -> None:
        """SetEntityState: where a character on a floating base begins, while it is stopped."""
        del response
        name, entities = request.entity, self._own.entities
        character = entities.characters.get(name)
        if character is None:
            entities.motion(name)  # which refuses a name that is none
            raise RefusedRequestError(
                Code.OPERATION_FAILED, "a ball or box is not moved; spawn another one"
            )
        if not character.layout.has_floating_base:
            raise RefusedRequestError(
                Code.OPERATION_FAILED, f"{name!r} is fixed; the parameter 'placement' places it"
            )
        if self.state is not State.STOPPED:
            raise RefusedRequestError(
                Code.INCORRECT_STATE,
                f"it is {self.state.name}; a state is taken while it is stopped (state 0), and "
                "that of the start from then on",
            )
        position, velocity = (
            values.copy() for values in (character.state.position, character.state.velocity)
        )
        _place(request, position, velocity)
        prefix = character.setup.prefix
        start = {prefix + POSITION: position.tolist(), prefix + VELOCITY: velocity.tolist()}
        if reason := self._own.begin_with(start):
            raise RefusedRequestError(Code.OPERATION_FAILED, reason)
        self._stopped_tick = self._own.simulation.tick

    def spawn(self, request: Any, response: Any) -> None:
        """SpawnEntity: a ball or box, let go with the next tick."""
        if request.entity_namespace:
            raise RefusedRequestError(
                SpawnCode.NAMESPACE_INVALID, "a ball or box has no topics; it must be ''"
            )
        throw = requested_throw(request)
        response.entity_name = self._own.entities.spawn(
            request.name, throw, renames=bool(request.allow_renaming)
        )

    def load_world(self, request: Any, response: Any) -> None:
        """LoadWorld: the ground that there is, anew and stopped; another one is none that it can.

        It is chosen at the start of the node.
        """
        uri, text = resource_of(request)
        if not (uri or text):
            raise RefusedRequestError(WorldCode.NO_RESOURCE, "there is no uri")
        if uri != self._own.terrain:
            raise RefusedRequestError(
                WorldCode.UNSUPPORTED_FORMAT,
                f"the world is {self._own.terrain!r} while this node runs; another one is the "
                f"parameter 'terrain' of its start: {PLANE}, {NO_GROUND}, a shipped one, or a path",
            )
        self._stop()
        response.world.name = response.world.world_resource.uri = uri


def is_installed() -> bool:
    """Whether the package of these services' types is."""
    return find_spec(PACKAGE) is not None


def _fill(act: Callable[[Any, Any], Answer | None], request: Any, response: Any) -> Answer:
    """Act, and write the result, which GetSimulatorFeatures has not."""
    try:
        answer = act(request, response)
    except RefusedRequestError as refusal:
        _write(response, refusal.code, str(refusal))
        return Answer(True)
    if answer is None:
        _write(response, Code.OK)
    return answer or Answer(True)


def _write(response: Any, code: int, sentence: str = "") -> None:
    if hasattr(response, "result"):
        response.result.result = int(code)
        response.result.error_message = "" if code == Code.OK else sentence


def _place(request: Any, position: np.ndarray, velocity: np.ndarray) -> None:
    """Write a requested pose and twist, in the world, into those of a floating base (n,).

    Version 1 has no flags for what is to be set, and means all.
    """
    pose, twist, frame = request.state.pose, request.state.twist, request.state.header.frame_id
    if frame not in ("", WORLD):
        raise RefusedRequestError(
            INVALID_ENTITY_POSE, f"it is in {frame[:100]!r}; it must be in '{WORLD}'"
        )
    turn = rotations.exp(position[3:6])
    if getattr(request, "set_pose", True):
        turn = np.array([getattr(pose.orientation, name) for name in "xyzw"])
        norm = float(fixed_order.norm(turn))
        if not 0.99 < norm < 1.01:
            raise RefusedRequestError(
                INVALID_ENTITY_POSE, f"the quaternion's norm is {norm:g}; it must be 1"
            )
        turn /= norm
        position[:3] = [getattr(pose.position, name) for name in "xyz"]
        position[3:6] = rotations.log(turn)
    if getattr(request, "set_twist", True):
        velocity[:3] = [getattr(twist.linear, name) for name in "xyz"]
        angular = np.array([getattr(twist.angular, name) for name in "xyz"])
        velocity[3:6] = rotations.rotate(rotations.conjugate(turn), angular)
    if not (np.isfinite(position).all() and np.isfinite(velocity).all()):
        raise RefusedRequestError(INVALID_ENTITY_POSE, "a number is not finite")
