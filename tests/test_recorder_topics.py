"""What a bag holds beside states and torques: pushes always, contacts where they are asked for."""

import signal
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from physics import character, simulation
from ros import Processes, SimulatorClient, tick_of, wrench_message

from experiment.bags.reader import read_messages
from msgs_config import topics
from msgs_config.tick_clock import TickClock
from sim_node.pushes import Push

CLOCK = TickClock(240)
TICKS = 60
PUSHED_AT = 30
LINKS = [link.name for link in character("humanoid").links]

Messages = dict[str, dict[int, Any]]
"""By topic, the messages by tick."""


def record(
    processes: Processes, client: SimulatorClient, directory: Path, **parameters: object
) -> Messages:
    """A recorder beside a humanoid that falls and is pushed once; what the bag then holds."""
    recorder = processes.node(topics.RECORDER_NODE, directory=str(directory), **parameters)
    simulator = processes.simulator(
        "humanoid", max_ticks=TICKS, wait_for_subscribers=2, wrench_duration=3.0 / 240.0
    )
    state = client.first_state()
    client.spin_until(
        lambda: client.wrenches.get_subscription_count() == 2, "simulator and recorder"
    )
    client.wrenches.publish(
        wrench_message(
            CLOCK.stamp_ns(PUSHED_AT),
            [
                ("chest", [60.0, -40.0, 20.0, 1.0, 2.0, 3.0]),
                ("left_wrist", [0.0, 30.0] + [0.0] * 4),
            ],
            [[0.0, 0.1, 0.02], [0.0, 0.0, 0.05]],
        )
    )
    client.drive(state, TICKS, np.random.default_rng(4))
    assert simulator.wait() == 0
    recorder.send(signal.SIGINT)
    assert recorder.wait() == 0
    found: Messages = {}
    for message in read_messages(directory / "bag"):
        if message.type_name.startswith("sensor_msgs/"):
            decoded = message.decode()
            found.setdefault(message.topic, {})[tick_of(decoded)] = decoded
    return found


def vectors(wrench: Any) -> list[float]:
    return [getattr(part, axis) for part in (wrench.force, wrench.torque) for axis in "xyz"]


def pushes_of(message: Any) -> list[Push]:
    """What a message on `applied_wrench` says, as pushes of one tick."""
    return [
        Push(
            LINKS.index(name),
            np.array(vectors(wrench)),
            np.array([getattr(turn.translation, axis) for axis in "xyz"]),
            first_tick=1,
            ticks=1,
        )
        for name, wrench, turn in zip(
            message.joint_names, message.wrench, message.transforms, strict=True
        )
    ]


def test_a_bag_holds_all_that_repeats_a_run_with_pushes_and_its_contacts(
    processes: Processes, client: SimulatorClient, tmp_path: Path
) -> None:
    bag = record(processes, client, tmp_path / "run", contacts=True)

    assert list(bag["/external_wrench"]) == [PUSHED_AT]
    assert list(bag["/applied_wrench"]) == list(range(1, TICKS + 2))
    assert list(bag["/contacts"]) == list(range(1, TICKS + 2))
    pushed = [tick for tick, m in bag["/applied_wrench"].items() if m.joint_names]
    assert pushed == [PUSHED_AT + 1, PUSHED_AT + 2, PUSHED_AT + 3]
    with simulation("humanoid") as again:
        again.watches_contacts = True
        for tick in range(1, TICKS + 1):
            state = again.advance(
                effort_at(bag["/joint_torques"], tick),
                *pushes_of(bag["/applied_wrench"][tick + 1]),
            )
            assert list(bag["/joint_states"][tick + 1].position) == state.position.tolist()
            assert list(bag["/joint_states"][tick + 1].velocity) == state.velocity.tolist()
            contacts, message = again.actor.contacts, bag["/contacts"][tick + 1]
            assert contacts is not None
            rows = np.flatnonzero(contacts.touching).tolist()
            assert list(message.joint_names) == [LINKS[row] for row in rows]
            recorded = [vectors(wrench) for wrench in message.wrench]
            assert recorded == contacts.wrenches[rows].tolist()


def effort_at(torques: Mapping[int, Any], tick: int) -> Any:
    """The effort (n,) that answered a tick's state."""
    layout, message = character("humanoid").layout, torques[tick]
    given = dict(zip(message.name, message.effort, strict=True))
    return np.array([given.get(name, 0.0) for name in layout.dof_names])


def test_contacts_are_not_recorded_unless_they_are_asked_for(
    processes: Processes, client: SimulatorClient, tmp_path: Path
) -> None:
    bag = record(processes, client, tmp_path / "run")

    assert "/contacts" not in bag
    assert list(bag["/applied_wrench"]) == list(range(1, TICKS + 2))


def test_of_pushes_the_bag_may_hold_only_what_was_sent(
    processes: Processes, client: SimulatorClient, tmp_path: Path
) -> None:
    bag = record(processes, client, tmp_path / "run", applied_wrench=False)

    assert "/applied_wrench" not in bag
    assert list(bag["/external_wrench"]) == [PUSHED_AT]


def test_a_run_records_contacts_when_it_is_told_to(processes: Processes, tmp_path: Path) -> None:
    common = ("run", "--duration", "0.1", "--set", "controller_node.root_assistance:=false")
    topics_of = {}
    for name, more in {"with": ("--contacts",), "without": ()}.items():
        # one after the other: both are in the test's domain, and would hear each other
        run = processes.command(*common, *more, "--output", str(tmp_path / name))
        assert run.wait(60.0) == 0
        topics_of[name] = {message.topic for message in read_messages(tmp_path / name / "bag")}

    assert topics_of["with"] - topics_of["without"] == {"/contacts"}
    assert "/applied_wrench" in topics_of["without"]
