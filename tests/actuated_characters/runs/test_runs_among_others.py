"""Runs beside other simulators and stray messages in the same domain: the hash of the run alone."""

import json
import signal
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from rclpy.context import Context
from rclpy.serialization import serialize_message
from std_msgs.msg import Header, String
from trajectory_msgs.msg import JointTrajectory

from actuated_characters.bags.reader import read_messages
from msgs_config.bus.polling import DirectSubscription
from msgs_config.errors import MessageError
from msgs_config.messages import topics
from msgs_config.messages.cdr import read_frame_id, split_stamp
from msgs_config.messages.session import is_session
from tests.sim_node.interface.test_hostile_messages import mutants
from tests.support.ros import Client, Processes, joint_state, wait_until, wrench_message
from tests.support.runs import summary_of

pytestmark = pytest.mark.slow

TICKS = 480
CONTROLLER = topics.CONTROLLER_NODE
OTHER = "/other/sim_node#00000000000b"
SIMULATOR = "/sim_node#"
SLOW = 120.0  # s that a run may take on a machine that is busy with other things
NAP = 0.05  # s between rounds of noise: others work, too
MOVING = {"reference": "sine", "signal__dofs": ["hinge"]}
START = {"initial_position": [0.5], "initial_velocity": [0.3141592653589793]}  # of the sine
MOVES = ("--set", "controller_node.signal.dofs:=[hinge]")
RUN = ("run", "--character", "pendulum", "--reference", "sine", "--duration", "2")


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The state hash of the run alone."""
    folder = tmp_path_factory.mktemp("alone")
    processes = Processes(folder)
    try:
        run = processes.command(*RUN, *MOVES, "--in-process", "--output", "run")
        assert run.wait(SLOW) == 0, run.stderr
        return str(summary_of(folder / "run")["state_hash"])
    finally:
        processes.end()


class Noise(Client):
    """Sends what another simulator, its controller and mutants of both would."""

    def __init__(self, context: Context) -> None:
        super().__init__(context, "noise")
        rng = np.random.default_rng(7)
        self._rng = rng
        stamp = joint_state(2_083_333_333, ["hinge"], [1.0], [1.0], [0.5])  # of tick 500
        stamp.header.frame_id = OTHER
        push = wrench_message(0, [("tail", [1.0] * 6)])
        configuration = json.dumps({"session": OTHER, "character": "x", "joints": []})
        trajectory = JointTrajectory(joint_names=["tail"])
        self._sources = [
            (self.speak(topic), mutants(bytes(serialize_message(message)), rng))
            for topic, message in (
                (topics.JOINT_STATES, stamp),
                (topics.JOINT_TORQUES, stamp),
                (topics.CONTACTS, push),
                (topics.EXTERNAL_WRENCH, push),
                (topics.THROW, stamp),
                (topics.CONFIGURATION.of(topics.SIM_NODE), String(data=configuration)),
                (topics.EPISODE, Header(frame_id=f"3 {OTHER}", stamp=stamp.header.stamp)),
                (topics.JOINT_TRAJECTORY.of(CONTROLLER), trajectory),
                (topics.STRENGTH.of(CONTROLLER), joint_state(0, ["tail"], effort=[0.5])),
            )
        ]
        self._episodes = self.speak(topics.EPISODE)
        self._states = self.speak(topics.JOINT_STATES)
        self._whole = stamp
        self.sessions: list[str] = []  # of all contacts that name one, in their order
        # not the states: simulators wait until so many subscribe to them, the recorder among them
        self._heard = DirectSubscription(self.node, topics.CONTACTS.for_listener())

    def hear(self) -> None:
        """Take all contacts that have come."""
        while (raw := self._heard.take()) is not None:
            with suppress(MessageError):
                session = read_frame_id(raw)
                if is_session(session) and session.startswith(SIMULATOR):
                    self.sessions.append(session)

    def send(self) -> None:
        """One round: mutants, an episode of a random time, and a whole state."""
        self.hear()
        for publisher, source in self._sources:
            publisher.publish(next(source))
        header = Header(frame_id=str(self._rng.choice([f"1 {OTHER}", "1", "", OTHER])))
        stamp = int(self._rng.integers(-(10**10), 10**10)) * int(self._rng.integers(1, 1000))
        header.stamp.sec, header.stamp.nanosec = split_stamp(stamp)
        self._episodes.publish(header)
        self._states.publish(self._whole)


@pytest.fixture
def noise(context: Context) -> Iterator[Noise]:
    client = Noise(context)
    yield client
    client.close()


def sessions_in(bag: Path) -> set[str]:
    """The sessions of all that names one in a bag."""
    names = ["/joint_states", "/contacts", "/applied_wrench", "/episode"]
    return {read_frame_id(message.raw).split()[-1] for message in read_messages(bag, names)}


def test_a_run_among_three_simulators_and_noise_has_the_hash_that_it_has_alone(
    processes: Processes, noise: Noise, alone: str, tmp_path: Path
) -> None:
    # Arrange: an equal one and one at another rate were there before
    processes.simulator("pendulum", republish_period=0.1)
    processes.simulator("pendulum", rate=500, republish_period=0.1)
    wait_until(lambda: len(set(noise.sessions)) == 2, "their states", step=noise.hear)
    before = set(noise.sessions)

    # Act: one of another character comes while it runs
    slowly = ("--set", "sim_node.real_time_factor:=1.0")
    less = ("--exclude", "visualization")
    run = processes.command(*RUN, *MOVES, *slowly, *less, "--output", "run")
    late: list[object] = []

    def ended() -> bool:
        noise.send()
        if not late and sum(session not in before for session in noise.sessions) > 20:
            late.append(processes.simulator("lift", republish_period=0.1))
        return run.exit_code is not None

    wait_until(ended, "the run's end", SLOW, lambda: time.sleep(NAP))

    # Assert
    assert run.exit_code == 0, run.stderr
    assert late
    found = summary_of(tmp_path / "run")
    assert found["ticks"] == TICKS
    assert found["state_hash"] == alone
    assert found["foreign_messages"]["/joint_states"] > 10
    assert len(sessions_in(tmp_path / "run" / "bag")) == 1
    log = (tmp_path / "run" / "logs" / "controller_node.log").read_text()
    assert "'rate'" not in log


def test_nodes_without_a_session_stay_with_the_simulator_that_they_began_with(
    processes: Processes, noise: Noise, alone: str, tmp_path: Path
) -> None:
    # Arrange
    recorder = processes.node(topics.RECORDER_NODE, directory="run")
    controller = processes.controller("pendulum", wait_for_subscribers=2, **MOVING)
    simulator = processes.simulator(
        "pendulum", max_ticks=TICKS, wait_for_subscribers=2, real_time_factor=0.5, **START
    )
    wait_until(lambda: len(noise.sessions) > 20, "a simulation that runs", step=noise.hear)

    # Act
    rivals = [processes.simulator("pendulum"), processes.simulator("lift", rate=500)]

    def ended() -> bool:
        noise.send()
        return simulator.exit_code is not None

    wait_until(ended, "the end", SLOW, lambda: time.sleep(NAP))
    recorder.send(signal.SIGINT)

    # Assert
    assert simulator.wait() == recorder.wait() == 0
    assert controller.exit_code is None
    assert all(rival.exit_code is None for rival in rivals)
    found = summary_of(tmp_path / "run")
    assert (found["ticks"], found["state_hash"]) == (TICKS, alone)
    assert sum("was recorded" in line for line in recorder.stderr.splitlines()) == 0


def test_of_two_simulators_that_start_together_one_is_recorded_whole(
    processes: Processes, alone: str, tmp_path: Path
) -> None:
    recorder = processes.node(topics.RECORDER_NODE, directory="run")
    processes.controller("pendulum", wait_for_subscribers=2, **MOVING)
    both = [
        processes.simulator("pendulum", max_ticks=TICKS, wait_for_subscribers=2, **START)
        for _ in range(2)
    ]

    wait_until(lambda: all(each.exit_code is not None for each in both), "their ends", SLOW)
    recorder.send(signal.SIGINT)

    # the controller takes up the second one when the first has ended; the recorder has one of them
    assert [each.wait() for each in both] == [0, 0]
    assert recorder.wait() == 0
    found = summary_of(tmp_path / "run")
    assert (found["ticks"], found["state_hash"]) == (TICKS, alone)
    assert found["foreign_messages"]["/joint_states"] > 0
    assert len(sessions_in(tmp_path / "run" / "bag")) == 1
