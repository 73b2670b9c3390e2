"""The services of `simulation_interfaces`, by messages with its fields, on a bus without ROS.

The numbers expected are those of its `.msg` and `.srv` files.
"""

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from msgs_config.bus.in_process import Bus, InProcessExecutor, InProcessNode
from msgs_config.bus.node import Answer
from msgs_config.messages import topics, typed
from msgs_config.messages.joint_state import JointStateDecoder, JointStateEncoder
from sim_node import node as sim_node_module
from sim_node.node import SimNode
from tests.support.interface_types import PlayedGoal, message

UNSUPPORTED, OK, NOT_FOUND, INCORRECT_STATE, FAILED = range(5)
STOPPED, PLAYING, PAUSED, QUITTING = range(4)
BOX_URDF = """<robot name="crate"><link name="crate"><inertial><mass value="3"/></inertial>
<collision><geometry><box size="0.4 0.3 0.2"/></geometry></collision></link></robot>"""


class World:
    """A simulator on a bus of its own, whose states are answered by zero torques."""

    def __init__(self, character: str, **parameters: object) -> None:
        bus = Bus(write=lambda *_: None)
        self.place: InProcessNode = bus.node(
            topics.SIM_NODE, {"character": character, "engine": "mujoco", **parameters}
        )
        client = bus.node("client", {})
        self._states = client.subscription(topics.JOINT_STATES)
        self._torques = client.publisher(topics.JOINT_TORQUES)
        self.applied = client.subscription(topics.APPLIED_THROW)
        self.node = SimNode(self.place)
        self.is_over, self.last = False, None
        self._turns = self.node.turns(False, InProcessExecutor())  # type: ignore[arg-type]
        self.turn()

    def turn(self, count: int = 1) -> None:
        """Turns of the simulator, each after an answer to its last state."""
        for _ in range(count):
            while (raw := self._states.take()) is not None:
                self.last = JointStateDecoder().decode(raw)
            if self.last is not None:
                names = [name for name in self.last.names if not name.startswith("root")]
                encoder = JointStateEncoder(names, self.last.frame_id)
                zero = np.zeros(len(names))
                self._torques.publish(encoder.encode(self.last.stamp_ns, effort=zero))
            self.is_over = self.is_over or next(self._turns, None) is None

    def begin(self, service: str, kind: str, **fields: Any) -> tuple[Answer, Any]:
        response = message(f"{kind}Response")
        handler = self.place.typed_handlers[service]
        return handler(message(f"{kind}Request", **fields), response), response

    def call(self, service: str, kind: str, **fields: Any) -> Any:
        answer, response = self.begin(service, kind, **fields)
        assert answer.is_given
        return response

    def set_state(self, state: int) -> Any:
        wanted = message("SimulationState", state=state)
        return self.call("set_simulation_state", "SetSimulationState", state=wanted).result

    @property
    def state(self) -> int:
        return int(self.call("get_simulation_state", "GetSimulationState").state.state)

    def entities(self, **filters: Any) -> Any:
        wanted = message("EntityFilters", **filters)
        return self.call("get_entities", "GetEntities", filters=wanted)

    def motion(self, entity: str) -> Any:
        return self.call("get_entity_state", "GetEntityState", entity=entity)

    def spawn(self, **fields: Any) -> Any:
        pose = typed.new("geometry_msgs/msg/PoseStamped")
        pose.pose.position.z = 2.0
        given = {"name": "thing", "uri": "ball", "initial_pose": pose, **fields}
        return self.call("spawn_entity", "SpawnEntity", **given)

    @property
    def tick(self) -> int:
        return self.node._simulation.tick


@pytest.fixture
def make(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., World]]:
    monkeypatch.setattr(sim_node_module, "is_installed", lambda: True)
    made: list[World] = []

    def one(character: str = "pendulum", **parameters: object) -> World:
        made.append(World(character, **parameters))
        return made[-1]

    yield one
    for each in made:
        each.node.destroy_node()


def test_the_features_are_those_of_its_services(make: Callable[..., World]) -> None:
    features = make().call("get_simulator_features", "GetSimulatorFeatures").features

    assert list(features.features) == [0, 8, 9, 10, 11, 20, 22, 23, 24, 25, 26, 31, 32, 33]
    assert features.spawn_formats == ["urdf"]


def test_states_are_set_and_said(make: Callable[..., World]) -> None:
    world = make()
    world.turn(5)
    assert (world.state, world.tick > 1) == (PLAYING, True)
    assert world.set_state(PLAYING).result == 101  # already in it

    assert world.set_state(PAUSED).result == OK
    paused_at = world.tick
    world.turn(5)
    assert (world.state, world.tick) == (PAUSED, paused_at)

    assert world.set_state(STOPPED).result == OK
    world.turn(5)
    assert (world.state, world.last.position.tolist()) == (STOPPED, [0.5])  # the rest pose
    assert world.set_state(4).result == 103  # no world: not to be set
    assert world.set_state(PLAYING).result == OK
    world.turn(5)
    assert world.last.position.tolist() != [0.5]


def test_quitting_ends_the_node(make: Callable[..., World]) -> None:
    world = make()

    assert world.set_state(QUITTING).result == OK
    world.turn(2)

    assert world.is_over


def test_a_simulation_that_has_diverged_does_not_play_again(make: Callable[..., World]) -> None:
    world = make()
    world.node._control.pause("diverged at tick 7", diverged=True)

    result = world.set_state(PLAYING)

    assert result.result == 102 and "diverged at tick 7" in result.error_message
    assert world.call("reset_simulation", "ResetSimulation").result.result == OK
    assert world.set_state(PLAYING).result == OK


@pytest.mark.parametrize(
    ("scope", "expected"), [(0, OK), (255, OK), (6, OK), (1, UNSUPPORTED), (2, UNSUPPORTED)]
)
def test_a_reset_is_a_whole_one(make: Callable[..., World], scope: int, expected: int) -> None:
    world = make()
    world.turn(4)
    before = world.last.stamp_ns

    assert world.call("reset_simulation", "ResetSimulation", scope=scope).result.result == expected
    world.set_state(PAUSED)
    world.turn()

    assert (world.last.position.tolist() == [0.5]) == (expected == OK)
    assert world.last.stamp_ns >= before  # time goes on


def test_steps_are_taken_while_paused_and_answered_when_done(make: Callable[..., World]) -> None:
    world = make()
    refused = world.call("step_simulation", "StepSimulation", steps=2)
    assert refused.result.result == FAILED and "paused" in refused.result.error_message
    world.set_state(PAUSED)
    before = world.tick

    answer, response = world.begin("step_simulation", "StepSimulation", steps=3)
    assert not answer.is_given
    world.turn(6)

    assert answer.is_given and response.result.result == OK
    assert (world.tick, world.state) == (before + 3, PAUSED)
    none = world.call("step_simulation", "StepSimulation", steps=0)
    assert none.result.result == FAILED


def steps_goal(world: World, steps: int) -> tuple[PlayedGoal, Answer]:
    goal = PlayedGoal(
        message("StepsGoal", steps=steps),
        message("StepsResult"),
        lambda: message("StepsFeedback"),
    )
    return goal, world.place.goal_handlers["simulate_steps"](goal)


def test_the_action_tells_each_step(make: Callable[..., World]) -> None:
    world = make()
    world.set_state(PAUSED)

    goal, answer = steps_goal(world, 3)
    world.turn(6)

    told = [(each.completed_steps, each.remaining_steps) for each in goal.told]
    assert told == [(1, 2), (2, 1), (3, 0)]
    assert answer.success and goal.result.result.result == OK


def test_an_action_that_is_cancelled_ends_its_steps(make: Callable[..., World]) -> None:
    world = make()
    world.set_state(PAUSED)
    goal, answer = steps_goal(world, 100)
    world.turn(3)

    goal.is_cancelled = True
    world.turn(3)

    assert answer.is_given and not answer.success and world.state == PAUSED
    stopped_at = world.tick
    world.turn(3)
    assert world.tick == stopped_at


def test_the_action_is_refused_while_playing(make: Callable[..., World]) -> None:
    goal, answer = steps_goal(make(), 3)

    assert answer.is_given and not answer.success
    assert goal.result.result.result == FAILED


def test_entities_are_found_by_name_and_category(make: Callable[..., World]) -> None:
    world = make("humanoid")
    world.spawn(name="apple")
    world.turn(3)

    assert world.entities().entities == ["humanoid", "apple"]
    assert world.entities(filter="^a").entities == ["apple"]
    robots = [message("EntityCategory", category=1)]
    assert world.entities(categories=robots).entities == ["humanoid"]
    tags = message("TagsFilter", tags=["red"])
    assert world.entities(tags=tags).result.result == UNSUPPORTED
    assert world.entities(bounds=message("Bounds", type=3)).result.result == UNSUPPORTED
    assert world.entities(filter="(").result.result == FAILED


def test_a_ball_falls_from_where_it_was_spawned(make: Callable[..., World]) -> None:
    world = make("humanoid")
    world.set_state(PAUSED)
    pose = typed.new("geometry_msgs/msg/PoseStamped")
    pose.pose.position.x, pose.pose.position.z = 5.0, 2.0
    spawned = world.spawn(name="apple", uri="ball?mass=0.2&radius=0.04", initial_pose=pose)
    assert (spawned.result.result, spawned.entity_name) == (OK, "apple")
    assert world.motion("apple").state.pose.position.z == 2.0  # not let go yet

    world.set_state(PLAYING)
    world.turn(24)

    ticks = world.tick - world.node._first_tick
    fallen = world.motion("apple").state
    assert fallen.twist.linear.z == pytest.approx(-9.81 * ticks / 240, rel=1e-6)
    assert fallen.pose.position.z == pytest.approx(2.0 - 9.81 / 2 * (ticks / 240) ** 2, abs=5e-3)
    assert fallen.pose.position.x == 5.0 and fallen.header.frame_id == "world"
    assert world.applied.take() is not None  # as of any throw, so a replay has it


def test_a_box_is_spawned_from_a_urdf_and_goes_with_a_reset(make: Callable[..., World]) -> None:
    world = make("humanoid")
    pose = typed.new("geometry_msgs/msg/PoseStamped")
    pose.pose.position.x, pose.pose.position.z = 5.0, 0.1
    pose.pose.orientation.z, pose.pose.orientation.w = math.sin(0.4), math.cos(0.4)
    resource = message("Resource", resource_string=BOX_URDF)
    response = message("SpawnEntity2Response")
    request = message(
        "SpawnEntity2Request", name="crate", entity_resource=resource, initial_pose=pose
    )
    world.place.typed_handlers["spawn_entity"](request, response)
    world.turn(3)

    assert response.result.result == OK
    assert world.motion("crate").state.pose.orientation.z == pytest.approx(math.sin(0.4), abs=1e-3)
    assert world.call("reset_simulation", "ResetSimulation").result.result == OK
    assert world.motion("crate").result.result == NOT_FOUND


@pytest.mark.parametrize(
    ("fields", "code", "says"),
    [
        ({"uri": ""}, 104, "no resource"),
        ({"uri": "file:///cup.sdf"}, 103, "unknown uri"),
        ({"uri": "ball?mass=heavy"}, 106, "mass is 'heavy'"),
        ({"uri": "ball?size=1"}, 106, "mass, radius"),
        ({"uri": "box?size=1,2"}, 106, "3 numbers"),
        ({"uri": "ball?mass=1e9"}, 106, "0.001 to 10000"),
        ({"uri": "", "resource_string": "<robot"}, 106, "no XML"),
        ({"uri": "", "resource_string": "<sdf/>"}, 103, "<sdf>"),
        ({"uri": "", "resource_string": BOX_URDF.replace("box", "mesh")}, 103, "<mesh>"),
        ({"name": "humanoid"}, 101, "there already"),
        ({"name": ""}, 102, "letters"),
        ({"entity_namespace": "left"}, 105, "no topics"),
    ],
)
def test_what_cannot_be_spawned_is_refused_by_its_code(
    make: Callable[..., World], fields: dict[str, str], code: int, says: str
) -> None:
    world = make("humanoid")

    result = world.spawn(**fields).result

    assert result.result == code and says in result.error_message
    assert "\n" not in result.error_message
    assert world.entities().entities == ["humanoid"]


def test_poses_that_cannot_be_are_refused(make: Callable[..., World]) -> None:
    world = make("humanoid")
    for x, w, frame in ((0.0, 0.0, ""), (0.6, 0.8, ""), (0.0, 1.0, "map")):
        pose = typed.new("geometry_msgs/msg/PoseStamped")
        pose.pose.orientation.x, pose.pose.orientation.w = x, w
        pose.header.frame_id = frame

        assert world.spawn(initial_pose=pose).result.result == 109


def test_names_that_are_taken_are_changed_if_that_is_allowed(make: Callable[..., World]) -> None:
    world = make("humanoid")

    names = [world.spawn(name=name, allow_renaming=True).entity_name for name in ("a", "a", "")]

    assert names == ["a", "a_2", "ball"]


def test_a_character_is_placed_while_stopped_and_begins_there_again(
    make: Callable[..., World],
) -> None:
    world = make("humanoid")
    state = message("EntityState")
    state.pose.position.x, state.pose.position.z = 1.0, 1.5
    state.pose.orientation.z, state.pose.orientation.w = math.sin(0.5), math.cos(0.5)
    state.twist.linear.y, state.twist.angular.x = 0.25, 0.5

    early = world.call("set_entity_state", "SetEntityState", entity="humanoid", state=state)
    assert early.result.result == INCORRECT_STATE
    world.set_state(STOPPED)
    done = world.call("set_entity_state", "SetEntityState", entity="humanoid", state=state)
    assert (done.result.result, world.state) == (OK, STOPPED)

    for _ in range(2):
        found = world.motion("humanoid").state
        for part in ("pose", "twist"):
            for vector in ("position", "orientation", "linear", "angular"):
                if hasattr(getattr(state, part), vector):
                    ours = getattr(getattr(found, part), vector)
                    theirs = getattr(getattr(state, part), vector)
                    assert [ours.x, ours.y, ours.z] == pytest.approx(
                        [theirs.x, theirs.y, theirs.z], abs=1e-9
                    )
        world.set_state(PLAYING)
        world.turn(3)
        world.set_state(STOPPED)


def test_only_what_is_flagged_is_set(make: Callable[..., World]) -> None:
    world = make("humanoid")
    world.set_state(STOPPED)
    before = world.motion("humanoid").state.pose
    state, response = message("EntityState"), message("SetEntityState2Response")
    state.twist.linear.x = 0.5
    request = message("SetEntityState2Request", entity="humanoid", state=state, set_twist=True)

    world.place.typed_handlers["set_entity_state"](request, response)

    after = world.motion("humanoid").state
    assert response.result.result == OK and after.twist.linear.x == 0.5
    assert after.pose.position.z == pytest.approx(before.position.z, abs=1e-12)


def test_what_cannot_be_placed_is_refused(make: Callable[..., World]) -> None:
    world = make("pendulum")
    world.set_state(STOPPED)
    state = message("EntityState")

    fixed = world.call("set_entity_state", "SetEntityState", entity="pendulum", state=state)
    nobody = world.call("set_entity_state", "SetEntityState", entity="nobody", state=state)

    assert fixed.result.result == FAILED and "placement" in fixed.result.error_message
    assert nobody.result.result == NOT_FOUND and "pendulum" in nobody.result.error_message


def test_the_world_that_is_there_is_loaded_again_and_no_other(make: Callable[..., World]) -> None:
    world = make()
    world.turn(4)

    assert world.call("load_world", "LoadWorld", uri="").result.result == 102
    other = world.call("load_world", "LoadWorld", uri="moon.sdf").result
    assert other.result == 101 and "'terrain'" in other.error_message
    assert world.call("load_world", "LoadWorld", uri="plane").result.result == OK
    assert world.state == STOPPED


def test_without_the_package_there_are_none() -> None:
    world = World("pendulum")

    assert not world.place.typed_handlers and not world.place.goal_handlers
    world.node.destroy_node()
