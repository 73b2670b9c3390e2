"""What a node makes of senders that are wrong, hostile, too many or too fast.

Every message is judged twice: by the node, and here by rclpy's own decoder and the contract.
"""

import json
import math
import struct
from collections import Counter
from collections.abc import Iterator

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState, MultiDOFJointState
from std_msgs.msg import Header, String

from msgs_config.character.layout import ROOT, JointLayout
from msgs_config.messages import topics
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedState
from sim_node.physics.wrenches import ExternalWrench
from tests.support.physics import character, controller, simulation
from tests.support.ros import (
    LOG_LINES,
    ControllerClient,
    Processes,
    SimulatorClient,
    assert_quiet,
    joint_state,
    stamp_ns,
    tick_of,
    wrench_message,
)

pytestmark = pytest.mark.slow

CLOCK = TickClock(240)
MESSAGES = 4_000
A_TICK = 100  # messages
LARGEST = 1e3  # N m, of what is sent: more would make it diverge, which is another matter
HUGE = 0xFFFF_FFF0


def mutants(valid: bytes, rng: np.random.Generator) -> Iterator[bytes]:
    """Endless: random bytes, and valid ones cut off, changed, or with a hostile length.

    All are a multiple of four long: the middleware fills up others with bytes of its own, which
    may well make a whole message of one that lacks its last byte.
    """
    valid += bytes(-len(valid) % 4)
    while True:
        kind = int(rng.integers(5))
        content = bytearray(valid)
        if kind == 0:
            content = bytearray(rng.bytes(4 * int(rng.integers(1, 75))))
        elif kind == 1:
            content = content[: 4 * int(rng.integers(1, len(content) // 4))]
        elif kind == 2:
            for place in rng.integers(0, len(content), int(rng.integers(1, 4))):
                content[place] = int(rng.integers(256))
        elif kind == 3:
            place = 4 * int(rng.integers(1, len(content) // 4))
            struct.pack_into("<I", content, place, int(rng.choice([HUGE, 2**31, 10**6, 0, 1])))
        else:
            place = 4 * int(rng.integers(1, len(content) // 4 - 1))
            hostile = rng.choice([math.nan, math.inf, -math.inf, 1e308, -0.0, 0.5])
            struct.pack_into("<d", content, place, float(hostile))
        yield bytes(content)


def judge_command(layout: JointLayout, raw: bytes, now_ns: int) -> tuple[str, JointState | None]:
    """What the contract makes of a command, and the command if it counts."""
    try:
        command = deserialize_message(raw, JointState)
    except Exception:  # rclpy has no type of its own for it
        return "rejected", None
    motors = [name for name in layout.dof_names if not name.startswith(f"{ROOT}_")]
    names = list(command.name)
    whole = all(
        set(joint.dof_names) <= set(names) or not set(joint.dof_names) & set(names)
        for joint in layout.joints
    )
    if (
        not names
        or not set(names) <= set(motors)
        or len(set(names)) < len(names)
        or not whole
        or len(command.effort) != len(names)
        or not np.isfinite(command.effort).all()
    ):
        return "rejected", None
    stamp = stamp_ns(command)
    if stamp != now_ns:
        return ("stale" if stamp < now_ns else "future"), None
    return "accepted", command


@pytest.mark.parametrize(("name", "messages"), [("pendulum", MESSAGES), ("humanoid", 2000)])
def test_no_bytes_on_the_topic_of_commands_are_applied_but_commands(
    processes: Processes, client: SimulatorClient, name: str, messages: int
) -> None:
    simulator = processes.simulator(name, wait_for_subscribers=1)
    layout, rng = character(name).layout, np.random.default_rng(1)
    motors = [name for name in layout.dof_names if not name.startswith(f"{ROOT}_")]
    state = client.first_state()
    counts = Counter({"sent": 0})
    before = simulator.peak_memory
    before_ns: set[int] = set()

    while counts["sent"] < messages:
        efforts = dict(zip(motors, rng.uniform(-2.0, 2.0, len(motors)).tolist(), strict=True))
        right = joint_state(stamp_ns(state), motors, effort=list(efforts.values()))
        source = mutants(bytes(serialize_message(right)), rng)
        for _ in range(A_TICK):
            raw = next(source)
            verdict, command = judge_command(layout, raw, stamp_ns(state))
            if verdict == "stale" and stamp_ns(deserialize_message(raw, JointState)) in before_ns:
                continue  # another command for a tick that was is a conflict; see test_floods.py
            if command is not None and (
                len(command.name) < len(motors) or np.abs(command.effort).max() > LARGEST
            ):
                continue
            client.torques.publish(raw)
            counts.update([verdict, "sent"])
            if command is not None:  # it is a command after all, and completes the tick
                efforts = dict(zip(command.name, command.effort, strict=True))
                break
        else:
            client.torques.publish(right)
            counts["accepted"] += 1
        before_ns.add(stamp_ns(state))
        state = client.state(tick_of(state) + 1)

        applied = dict(zip(state.name, state.effort, strict=True))
        limits = character(name).effort_limits()
        expected = np.array([efforts.get(dof, 0.0) for dof in layout.dof_names])
        assert list(applied.values()) == (layout.clipped(expected, limits) + 0.0).tolist()

    del counts["sent"]
    assert counts["rejected"] > 0.5 * messages
    client.diagnostics.messages.clear()
    client.reported(**counts, conflict=0, tick=tick_of(state), paused=False)
    assert_quiet(simulator)
    assert simulator.peak_memory < before + 100.0


def counts_as_push(links: set[str], raw: bytes, now_ns: int) -> MultiDOFJointState | None:
    """The push that the contract makes of some bytes, if it makes one."""
    try:
        push = deserialize_message(raw, MultiDOFJointState)
    except Exception:  # rclpy has no type of its own for it
        return None
    count = len(push.joint_names)
    if not count or not set(push.joint_names) <= links or len(push.wrench) != count:
        return None
    numbers = np.array(_numbers(push))
    late = stamp_ns(push) and CLOCK.first_tick_from(stamp_ns(push)) < now_ns * 240e-9 - 0.5
    if late or len(push.transforms) not in (0, count) or not np.isfinite(numbers).all():
        return None
    return push


def _numbers(push: MultiDOFJointState) -> list[float]:
    vectors = [v for w in push.wrench for v in (w.force, w.torque)]
    vectors += [t.translation for t in push.transforms]
    return [value for v in vectors for value in (v.x, v.y, v.z)]


def test_no_bytes_on_the_topic_of_pushes_push_anything_but_pushes(
    processes: Processes, client: SimulatorClient
) -> None:
    applied = client.listen(topics.APPLIED_WRENCH)
    simulator = processes.simulator("humanoid", wrench_duration=0.0, wait_for_subscribers=1)
    whole, rng = character("humanoid"), np.random.default_rng(2)
    rows = {link.name: row for row, link in enumerate(whole.links)}
    state = client.first_state()
    client.spin_until(lambda: applied.messages, "what is applied")
    sent: Counter[str] = Counter()
    allowed: set[tuple[float, ...]] = set()

    while sum(sent.values()) < MESSAGES:
        # a stamp that is not mutated is that of a tick that is surely to come
        right = wrench_message(
            stamp_ns(state) + 10**8,
            [("chest", rng.uniform(-0.5, 0.5, 6)), ("neck", rng.uniform(-0.5, 0.5, 6))],
            rng.uniform(-0.1, 0.1, (2, 3)).tolist(),
        )
        source = mutants(bytes(serialize_message(right)), rng)
        for _ in range(A_TICK // 2):
            raw = next(source)
            push = counts_as_push(set(rows), raw, stamp_ns(state))
            if push is not None and np.abs(_numbers(push)).max() > 0.5:
                continue
            if push is not None and 0 < abs(stamp_ns(push) - stamp_ns(right)) < 10**8:
                continue  # whether it is too late depends on when it comes
            client.wrenches.publish(raw)
            sent.update(["rejected_pushes" if push is None else "accepted_pushes"])
            if push is not None:
                allowed.add(tuple(_numbers(push)[: 6 * len(push.wrench)]))
        state = client.advance(state, {})
    for _ in range(30):
        state = client.advance(state, {})

    assert sent["accepted_pushes"] and sent["rejected_pushes"] > MESSAGES / 2
    client.diagnostics.messages.clear()
    client.reported(**sent, tick=tick_of(state), paused=False)
    client.spin_until(lambda: tick_of(applied.last) == tick_of(state), "all pushes")
    states, pushes = client.states.by_tick(), applied.by_tick()
    with simulation("humanoid", wrench_duration=0.0) as run:
        for tick in range(2, tick_of(state) + 1):
            message = pushes.get(tick, MultiDOFJointState())
            acts = [
                ExternalWrench(
                    rows[link], np.array(_numbers(one)[:6]), np.array(_numbers(one)[6:]), tick, 1
                )
                for link, one in _each(message)
            ]
            expected = run.advance(np.zeros(run.layout.size), *acts)
            assert list(states[tick].position) == expected.position.tolist()
    parts = {numbers[i : i + 6] for numbers in allowed for i in range(0, len(numbers), 6)}
    assert {tuple(_numbers(one)[:6]) for m in applied.messages for _, one in _each(m)} <= parts
    assert_quiet(simulator)


def _each(message: MultiDOFJointState) -> Iterator[tuple[str, MultiDOFJointState]]:
    for name, wrench, point in zip(
        message.joint_names, message.wrench, message.transforms, strict=True
    ):
        yield name, MultiDOFJointState(wrench=[wrench], transforms=[point])


# What the controller hears


def some_state(tick: int, *, first: bool = False) -> JointState:
    whole = character("pendulum")
    effort = [] if first else [0.0] * whole.layout.size
    return joint_state(CLOCK.stamp_ns(tick), whole.layout.dof_names, [0.4], [0.1], effort)


def assert_answers(simulator: ControllerClient, tick: int) -> None:
    """It answers the first state of an episode as the controller without ROS does."""
    torques = simulator.ask(some_state(tick, first=True))
    state = StampedState(CLOCK.stamp_ns(tick), np.array([0.4]), np.array([0.1]), None)
    expected, _ = controller("pendulum").compute_effort(state, state.stamp_ns)
    assert list(torques.effort) == expected.tolist()


@pytest.mark.parametrize("topic", ["joint_states", "episode", "sim_node/configuration"])
def test_no_bytes_on_a_topic_that_the_controller_hears_end_it_or_make_it_wrong(
    processes: Processes, simulator: ControllerClient, topic: str
) -> None:
    node = processes.controller()
    assert_answers(simulator, 1)
    configuration = json.dumps({"character": "pendulum", "joints": [{"name": "hinge"}]})
    valid = {
        "joint_states": some_state(2),
        "episode": Header(frame_id="1"),
        "sim_node/configuration": String(data=configuration),
    }[topic]
    contract = {
        "joint_states": topics.JOINT_STATES,
        "episode": topics.EPISODE,
        "sim_node/configuration": topics.CONFIGURATION.of(topics.SIM_NODE),
    }[topic]
    publisher = {"joint_states": simulator.states, "episode": simulator.episodes}.get(topic)
    publisher = publisher or simulator.speak(contract)
    simulator.spin_until(publisher.get_subscription_count, "a controller that listens")
    before = node.peak_memory
    source = mutants(bytes(serialize_message(valid)), np.random.default_rng(3))

    for tick in range(2, 2 + MESSAGES // A_TICK):
        for _ in range(A_TICK):
            publisher.publish(next(source))
        assert_answers(simulator, 10 * tick)

    assert node.exit_code is None
    assert_quiet(node)
    assert node.peak_memory < before + 100.0


CONFIGURATIONS = {
    "deep": "[" * 100_000,
    "a huge number": json.dumps(
        {"character": "x", "joints": [], "effort_limits": [], "mass": 0}
    ).replace('"mass": 0', '"mass": 1' + "0" * 400),
    "a joint twice": json.dumps(
        {
            "character": "x",
            "joints": [{"name": "a", "type": "revolute"}] * 2,
            "effort_limits": [],
            "mass": 1.0,
            "parameters": {},
        }
    ),
    "a list": "[]",
    "null": "null",
    "a surrogate": '{"character": "\\ud800"}',
    "an odd limit": json.dumps(
        {
            "character": "x",
            "joints": [{"name": "a", "type": "revolute"}],
            "effort_limits": [{}],
            "mass": 1.0,
            "parameters": {},
            "probe": {},
        }
    ),
}


@pytest.mark.parametrize("kind", CONFIGURATIONS)
def test_a_configuration_that_is_none_is_ignored_by_the_controller(
    processes: Processes, simulator: ControllerClient, kind: str
) -> None:
    node = processes.controller()
    assert_answers(simulator, 1)
    publisher = simulator.speak(topics.CONFIGURATION.of(topics.SIM_NODE))
    simulator.spin_until(publisher.get_subscription_count, "a controller that listens")

    publisher.publish(String(data=CONFIGURATIONS[kind]))
    told = simulator.spin_until(
        lambda: node.exit_code is not None or "configuration ignored" in node.stderr, "a warning"
    )

    assert told
    assert node.exit_code is None
    assert_answers(simulator, 10)
    assert_quiet(node)


def test_a_state_that_is_not_finite_gets_no_answer(
    processes: Processes, simulator: ControllerClient
) -> None:
    node = processes.controller()
    assert_answers(simulator, 1)

    for tick, wrong in ((2, math.nan), (3, math.inf), (4, -math.inf)):
        for position, velocity in ((wrong, 0.0), (0.0, wrong)):
            stamp = CLOCK.stamp_ns(tick)
            simulator.states.publish(joint_state(stamp, ["hinge"], [position], [velocity], [0.0]))
    assert_answers(simulator, 10)

    assert {tick_of(torques) for torques in simulator.torques.messages} == {1, 10}
    assert_quiet(node)


# Sizes


def test_lengths_that_are_wrong_are_not_told_at_every_message(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator()
    state = client.first_state()
    raw = bytearray(serialize_message(joint_state(stamp_ns(state), ["hinge"], effort=[1.0])))
    struct.pack_into("<I", raw, 20, HUGE)  # the number of names

    for _ in range(LOG_LINES):
        client.torques.publish(bytes(raw))
    client.advance(state, {})

    client.reported(rejected=LOG_LINES)
    assert len(simulator.stderr.splitlines()) < LOG_LINES / 2


def test_a_name_of_endless_length_is_not_repeated_in_full(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator()
    state = client.first_state()

    for letter in "abc":
        client.command(stamp_ns(state), {letter * 1_000_000: 1.0})
        push = wrench_message(0, [(letter * 1_000_000, [1.0] * 6)])
        client.wrenches.publish(push)

    client.reported(answering=state, rejected=3, rejected_pushes=3)
    assert_quiet(simulator)


def test_counts_that_promise_gigabytes_are_refused_without_taking_them(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator()
    state = client.first_state()
    for _ in range(10):
        state = client.advance(state, {})
    before = simulator.peak_memory

    for publisher, message in (
        (client.torques, joint_state(stamp_ns(state), ["hinge"], [1.0], [1.0], [1.0])),
        (client.wrenches, wrench_message(0, [("rod", [1.0] * 6)], [[0.0] * 3])),
    ):
        valid = bytes(serialize_message(message))
        for place in range(4, len(valid) - 4, 4):
            for count in (HUGE, 2**31 - 1, 2**28, 10**7):
                raw = bytearray(valid)
                struct.pack_into("<I", raw, place, count)
                if publisher is client.wrenches or place < len(valid) - 12:
                    publisher.publish(bytes(raw))
        state = client.advance(state, {"hinge": 1.0}) if publisher is client.torques else state
    for _ in range(20):
        state = client.advance(state, {})

    assert simulator.exit_code is None
    assert simulator.peak_memory < before + 100.0
