"""Behaviours over topics: contacts of the very tick, `~/mode`, strengths from their stamp on."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from sensor_msgs.msg import JointState

from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import make_plan
from msgs_config.errors import ConfigurationError
from msgs_config.messages import topics
from msgs_config.messages.cdr import split_stamp
from msgs_config.messages.clock import TickClock
from msgs_config.messages.wrenches import WrenchArrays, encode_wrenches
from tests.support.physics import character
from tests.support.ros import (
    ControllerClient,
    Processes,
    SimulatorClient,
    joint_state,
    stamp_ns,
    wait_until,
)

HUMANOID = character("humanoid")
CLOCK = TickClock(240)
REST = list(HUMANOID.rest_position)
CONTROLLER = topics.CONTROLLER_NODE


def state(tick: int, *, first: bool = False) -> JointState:
    """The humanoid at rest; the first state of an episode has no effort."""
    size = HUMANOID.layout.size
    effort = [] if first else [0.0] * size
    names = HUMANOID.layout.dof_names
    return joint_state(CLOCK.stamp_ns(tick), names, REST, [0.0] * size, effort)


class Ticks:
    """A simulator's place: states and contacts, tick by tick."""

    def __init__(self, client: ControllerClient, *, with_contacts: bool = True) -> None:
        self._client = client
        self.modes = client.listen(topics.MODE.of(CONTROLLER))
        self._contacts = client.speak(topics.CONTACTS) if with_contacts else None
        self.tick = 0
        self._first = 1

    def begin_at(self, tick: int) -> None:
        """Let the next state be an episode's first one, with this tick's stamp."""
        self._first, self.tick = tick, tick - 1
        self._client.torques.messages.clear()

    def touch(self, force: float) -> bytes:
        """The contacts of the present tick, in which a force pushes the chest."""
        rows = [[force, 0.0, 0.0, 0.0, 0.0, 0.0]] if force else []
        now_ns = CLOCK.stamp_ns(self.tick)
        return encode_wrenches(WrenchArrays.of_rows(now_ns, ["chest"] * len(rows), rows, []))

    def leave(self, force: float) -> None:
        """A tick whose contacts are published, and whose state is not."""
        self.tick += 1
        assert self._contacts is not None
        self._contacts.publish(self.touch(force))

    def again(self, force: float) -> None:
        """Other contacts of the tick whose state was answered."""
        assert self._contacts is not None
        self._contacts.publish(self.touch(force))

    def next(self, force: float = 0.0, *, state_first: bool = False) -> JointState:
        """The torques that answer the next state, before which a force pushed the chest."""
        self.tick += 1
        current = state(self.tick, first=self.tick == self._first)
        touched = self.touch(force)

        def send() -> None:
            if state_first:
                self._client.states.publish(current)
            if self._contacts is not None:
                self._contacts.publish(touched)
            if not state_first:
                self._client.states.publish(current)

        return self._client.spin_sending(send, lambda: self._reply(current), "an answer")

    def _reply(self, current: JointState) -> JointState | None:
        torques = self._client.torques.messages
        return next((m for m in torques if stamp_ns(m) == stamp_ns(current)), None)

    def wait_told(self, expected: list[tuple[str, int]], before: int = 0) -> None:
        """Wait until the modes published, without the first ones, are these."""
        self._client.spin_until(lambda: self.told()[before:] == expected, f"modes {expected}")

    def told(self) -> list[tuple[str, int]]:
        """The modes published so far, and their ticks."""
        contents = [json.loads(message.data) for message in self.modes.messages]
        return [(content["mode"], CLOCK.tick(content["stamp_ns"])) for content in contents]


@pytest.fixture
def ticks(processes: Processes, simulator: ControllerClient) -> Iterator[Ticks]:
    processes.controller("humanoid", behaviour="reactive", react__duration=0.02)
    yield Ticks(simulator)


def test_a_hit_counts_with_the_state_whose_contacts_hold_it(ticks: Ticks) -> None:
    for _ in range(3):
        ticks.next()
    ticks.next(force=1200.0, state_first=True)  # 5 N s: the state waits for its contacts
    ticks.next()

    ticks.wait_told([("TRACK", 1), ("REACT", 4)])
    content = json.loads(ticks.modes.last.data)
    assert content["link"] == "chest"
    assert content["impulse"] == pytest.approx(5.0)
    while len(ticks.modes) < 4 and ticks.tick < 30:
        ticks.next()
    names = [mode for mode, _ in ticks.told()]
    assert names == ["TRACK", "REACT", "SEARCH", "BLEND"]
    found = json.loads(ticks.modes.last.data)
    assert found["distance"] < found["median_distance"]


def test_a_simulator_that_is_started_again_finds_it_as_new(ticks: Ticks) -> None:
    # Arrange: another one has been hit, and ended
    for _ in range(20):
        ticks.next()
    ticks.next(force=2400.0)
    ticks.wait_told([("TRACK", 1), ("REACT", 21)])

    # Act: the first state has the stamp that the other one's had
    ticks.begin_at(1)
    ticks.next()
    ticks.next()
    ticks.next(force=1200.0, state_first=True)  # its contacts are waited for

    # Assert
    ticks.wait_told([("TRACK", 1), ("REACT", 3)], before=2)
    assert json.loads(ticks.modes.last.data)["impulse"] == pytest.approx(5.0)


def test_contacts_of_an_episode_that_was_reset_do_not_count_in_the_next(ticks: Ticks) -> None:
    for _ in range(3):
        ticks.next()
    ticks.leave(force=2400.0)  # the last state of the old episode gets no answer

    ticks.begin_at(ticks.tick + 1)
    for _ in range(3):
        ticks.next()
    ticks.next(force=1200.0)

    ticks.wait_told([("TRACK", 1), ("TRACK", 5), ("REACT", 8)])


def test_contacts_of_a_tick_that_was_answered_do_not_count_with_the_next_state(
    ticks: Ticks,
) -> None:
    for _ in range(3):
        ticks.next()
    ticks.again(force=2400.0)

    for _ in range(3):
        ticks.next()
    ticks.next(force=1200.0)

    ticks.wait_told([("TRACK", 1), ("REACT", 7)])
    assert json.loads(ticks.modes.last.data)["impulse"] == pytest.approx(5.0)


def test_a_contact_without_end_is_refused_in_a_line_and_ends_nothing(
    processes: Processes, simulator: ControllerClient
) -> None:
    node = processes.controller("humanoid", behaviour="reactive")
    ticks = Ticks(simulator)
    ticks.next()

    ticks.next(force=1e200)
    ticks.next(force=1200.0)

    ticks.wait_told([("TRACK", 1), ("REACT", 3)])
    (line,) = [line for line in node.stderr.splitlines() if "contacts ignored" in line]
    assert "1e+09 N" in line
    assert node.exit_code is None


def test_on_ground_that_it_does_not_know_a_behaviour_that_tells_hits_answers_nothing_and_says_why(
    processes: Processes, client: SimulatorClient, tmp_path: Path
) -> None:
    box = tmp_path / "box.urdf"
    box.write_text(
        '<robot name="box"><link name="box"><collision><geometry><box size="9 9 1"/></geometry>'
        "</collision></link></robot>"
    )
    own = {"behaviour": "reactive"}
    with pytest.raises(ConfigurationError, match=r"is plane, but sim_node's is .*box\.urdf;"):
        make_plan(
            "humanoid",
            0.5,
            {"reference": "clip"},
            {"terrain": str(box)},
            {**own, "terrain": "plane"},
        )
    for terrain in (str(box), "none"):
        make_plan("humanoid", 0.5, {"reference": "clip"}, {"terrain": terrain}, own)
    joints = ["root", *HUMANOID.layout.actuated_joint_names]

    processes.simulator("humanoid", terrain=str(box), commanded_joints=joints)
    node = processes.controller("humanoid", behaviour="reactive")

    wait_until(lambda: "waiting for a simulator that fits" in node.stderr, "a line")
    (line,) = node.stderr.splitlines()
    assert "state ignored: " in line and "reactive" in line and "box.urdf" in line


def test_without_a_behaviour_no_contacts_are_waited_for(
    processes: Processes, simulator: ControllerClient
) -> None:
    processes.controller("humanoid")
    without_contacts = Ticks(simulator, with_contacts=False)

    for _ in range(3):
        without_contacts.next()

    without_contacts.wait_told([("TRACK", 1)])
    count = simulator.node.count_subscribers(topics.CONTACTS.name)
    assert count == 0


def test_both_nodes_give_the_states_of_one_process(
    processes: Processes, client: SimulatorClient
) -> None:
    # Arrange
    own = {"behaviour": "reactive"}
    plan = make_plan("humanoid", 0.5, {"reference": "clip", "clip": "walk"}, {}, own)
    expected = list(ticks_in_process(plan))[-1].following
    states = client.listen(topics.JOINT_STATES)

    # Act
    processes.controller("humanoid", behaviour="reactive", reference="clip", clip="walk")
    values = plan.simulator
    simulator = processes.simulator(
        "humanoid",
        max_ticks=plan.ticks,
        wait_for_subscribers=2,
        commanded_joints=list(values["commanded_joints"]),
        initial_position=list(values["initial_position"]),
        initial_velocity=list(values["initial_velocity"]),
    )
    last = client.spin_until(
        lambda: next((m for m in states.messages if stamp_ns(m) == expected.stamp_ns), None),
        "the last state",
    )

    # Assert
    assert simulator.wait() == 0
    assert list(last.position) == expected.position.tolist()


def strength(tick: int = 0, **by_joint: float) -> JointState:
    message = JointState(name=list(by_joint), effort=list(by_joint.values()))
    stamp = CLOCK.stamp_ns(tick) if tick else 0
    message.header.stamp.sec, message.header.stamp.nanosec = split_stamp(stamp)
    return message


def test_strengths_begin_at_their_stamp_are_echoed_and_refused_in_a_line(
    processes: Processes, simulator: ControllerClient
) -> None:
    # Arrange
    node = processes.controller("humanoid", law="pd_gravity")
    driver = Ticks(simulator, with_contacts=False)
    active = simulator.listen(topics.ACTIVE_STRENGTH.of(CONTROLLER))
    sender = simulator.speak(topics.STRENGTH.of(CONTROLLER))
    whole = driver.next()
    simulator.spin_until(sender.get_subscription_count, "a subscriber")
    elbow = list(whole.name).index("left_elbow")
    knee = list(whole.name).index("left_knee")
    bent = [name for name in (elbow, knee) if whole.effort[name] != 0.0]

    # Act
    start = 2000
    for wrong in (strength(tail=0.5), strength(chest=2.0), strength(tick=1, chest=0.5)):
        sender.publish(wrong)
    sender.publish(strength(start, left_elbow=0.0, left_knee=0.0))
    while not len(active):
        driver.next()
    driver.tick = start - 2
    before, at = driver.next(), driver.next()

    # Assert
    assert stamp_ns(active.last) == CLOCK.stamp_ns(start)
    echoed = dict(zip(active.last.name, active.last.effort, strict=True))
    assert echoed == {
        name: 0.0 if name in ("left_elbow", "left_knee") else 1.0
        for name in HUMANOID.layout.actuated_joint_names
    }
    assert bent and all(before.effort[entry] == whole.effort[entry] for entry in bent)
    assert at.effort[elbow] == at.effort[knee] == 0.0
    assert np.abs(at.effort).max() > 0.0
    lines = [line for line in node.stderr.splitlines() if "refused strength" in line]
    assert [word in line for word, line in zip(("tail", "2", "over"), lines, strict=True)] == [
        True,
        True,
        True,
    ]


def test_behaviours_begin_at_their_stamp_are_echoed_and_refused_in_a_line(
    processes: Processes, simulator: ControllerClient
) -> None:
    def asked(*names: str, tick: int = 0) -> JointState:
        return joint_state(CLOCK.stamp_ns(tick) if tick else 0, names)

    node = processes.controller("humanoid", behaviour="active_ragdoll", limp__threshold=30.0)
    driver = Ticks(simulator)
    active = simulator.listen(topics.ACTIVE_BEHAVIOUR.of(CONTROLLER))
    sender = simulator.speak(topics.BEHAVIOUR.of(CONTROLLER))
    driver.next()
    simulator.spin_until(sender.get_subscription_count, "a subscriber")

    for wrong in (asked("tumble"), asked("react", "brace"), asked("react", tick=1)):
        sender.publish(wrong)
    sender.publish(asked("track"))
    sender.publish(asked("react", tick=2000))
    while len(active) < 2:
        driver.next()
    driver.tick = 1996
    for _ in range(5):
        driver.next(force=24_000.0)
    driver.wait_told([("TRACK", 1), ("LIMP", 2000)])

    assert [list(each.name) for each in active.messages] == [["track"], ["react"]]
    assert stamp_ns(active.last) == CLOCK.stamp_ns(2000)
    lines = [line for line in node.stderr.splitlines() if "refused behaviour" in line]
    words = ("'tumble'", "2 names", "over")
    assert all(word in line for word, line in zip(words, lines, strict=True))


def test_contacts_whose_states_never_come_are_dropped_and_it_is_logged_once(
    processes: Processes, simulator: ControllerClient
) -> None:
    node = processes.controller("humanoid", behaviour="reactive")
    driver = Ticks(simulator)
    driver.next()
    simulator.states.publish(state(2, first=False))  # it waits for its contacts
    before = node.peak_memory

    driver.tick = 10
    for count in range(8000):
        driver.leave(force=1.0)
        if count % 500 == 0:
            simulator.get_parameters(CONTROLLER, ["law"])  # it takes what has come
    wait_until(lambda: "the oldest are dropped" in node.stderr, "the warning")
    driver.tick = 1
    driver.next()

    assert node.stderr.count("the oldest are dropped") == 1
    assert node.peak_memory < before + 50.0
