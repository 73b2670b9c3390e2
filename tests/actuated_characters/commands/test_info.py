"""What `info` says of bags: of ours, of broken ones, of anybody's."""

import json
from pathlib import Path

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from actuated_characters.bags.writer import BagWriter
from actuated_characters.cli import main
from actuated_characters.commands.common.tables import show
from actuated_characters.report.contents import read_contents
from actuated_characters.report.facts import BagFacts, as_json, look_at
from actuated_characters.report.timing import lateness, pauses, state_times
from msgs_config.errors import RecordingError
from msgs_config.messages import topics
from msgs_config.messages.joint_state import JointStateEncoder
from msgs_config.messages.topic import STREAM, Topic
from tests.support.bags import Made, add_to, make_run, raw_configuration, raw_states, write_bag
from tests.support.eventful import (
    MS,
    START_NS,
    Eventful,
    eventful_run,
    raw_controller,
    write_timed,
)
from tests.support.foreign_bags import TextMessage, to_sqlite, write_humble_db3, write_metadata

PUSH = (100.0, 0.0, 50.0)
TICKS = 60


@pytest.fixture(scope="module")
def fall() -> Eventful:
    """A humanoid in real time, pushed in two ticks, reset, paused."""
    return eventful_run(
        "humanoid",
        TICKS,
        pushed=[(10, 12, "chest", PUSH), (40, 1, "left_knee", PUSH)],
        reset_after=30,
        pause_after=50,
        tick_ns=4 * MS,
        mode="realtime",
    )


@pytest.fixture(scope="module")
def facts(fall: Eventful, tmp_path_factory: pytest.TempPathFactory) -> BagFacts:
    messages = fall.messages()
    changed = {**fall.plan.controller, "gain_scale.p": 2.0}
    since = fall.states[20].stamp_ns
    configuration = raw_controller(fall.plan, changed, since)  # type: ignore[arg-type]
    messages.append((configuration, fall.log_times_ns[20]))
    messages.sort(key=lambda each: each[1])
    directory = tmp_path_factory.mktemp("fall")
    write_timed(directory / "bag", messages)
    return look_at(directory)


@pytest.fixture(scope="module")
def pendulum() -> Made:
    return make_run("pendulum", 0.05)


# Files and topics


def test_the_bag_and_its_topics_are_described(facts: BagFacts, fall: Eventful) -> None:
    contents = facts.contents
    topic = {topic.name: topic for topic in contents.topics}["/joint_states"]
    times = np.array(fall.log_times_ns)

    assert (topic.type_name, topic.count) == ("sensor_msgs/msg/JointState", TICKS + 1)
    assert topic.rate_hz == pytest.approx(TICKS / ((times[-1] - times[0]) / 1e9))
    assert topic.largest_gap_ns == np.diff(times).max() == 2_004 * MS
    assert set(contents.files) == {"bag.mcap", "metadata.yaml"}
    assert contents.files["bag.mcap"] == (contents.bag / "bag.mcap").stat().st_size
    assert (contents.storage, contents.version) == ("mcap", 9)
    assert contents.start_ns == START_NS - 2 * MS


@pytest.mark.parametrize(
    ("storage", "compression", "named"),
    [
        ("mcap", "none", "none"),
        ("mcap", "zstd", "zstd (chunks)"),
        ("sqlite3", "none", "none"),
        ("sqlite3", "zstd", "zstd (message)"),
    ],
)
def test_storage_compression_and_a_topic_without_messages_are_named(
    pendulum: Made, tmp_path: Path, storage: str, compression: str, named: str
) -> None:
    chunks = compression if storage == "mcap" else "none"
    with BagWriter(tmp_path / "own" / "bag", compression=chunks) as bag:
        add_to(bag, pendulum.messages())
        bag.add_topic("/contacts", topics.CONTACTS.type_name, topics.CONTACTS.quality)
    if storage == "sqlite3":
        compressed = compression == "zstd"
        to_sqlite(tmp_path / "own" / "bag", tmp_path / "other" / "bag", compressed=compressed)

    contents = read_contents(tmp_path / ("other" if storage == "sqlite3" else "own"))

    assert (contents.storage, contents.compression) == (storage, named)
    empty = {topic.name: topic for topic in contents.topics}["/contacts"]
    assert empty.count == 0 and empty.rate_hz is None


# A character


def test_a_character_is_described(facts: BagFacts, fall: Eventful) -> None:
    (stream,) = facts.streams

    assert (stream.name, stream.character) == ("", "humanoid")
    assert stream.degrees_of_freedom == fall.plan.character.layout.size == 34
    assert stream.mass == pytest.approx(fall.plan.character.mass)
    assert (stream.rate_hz, stream.mode) == (240, "realtime")
    assert (stream.ticks, stream.sim_time) == (TICKS, pytest.approx(TICKS / 240))
    assert "pybullet" in stream.versions
    assert facts.lacks is None


def test_episodes_resets_and_a_pause_by_the_wall_clock_are_found(facts: BagFacts) -> None:
    (run,), (pause,) = facts.runs, facts.streams[0].pauses

    assert run.resets == 1
    assert [episode.start for episode in run.episodes] == pytest.approx([0.0, 31 / 240])
    assert [e.duration for e in run.episodes] == pytest.approx([30 / 240, 29 / 240])
    assert (pause.start, pause.duration) == pytest.approx((50 / 240, 2.004))


def test_pushes_have_their_link_time_and_impulse(facts: BagFacts) -> None:
    chest, knee = facts.runs[0].pushes

    assert (chest.link, knee.link) == ("chest", "left_knee")
    assert (chest.start, chest.duration) == pytest.approx((10 / 240, 12 / 240))
    assert chest.largest_force == pytest.approx(np.linalg.norm(PUSH))
    assert chest.impulse == pytest.approx(np.linalg.norm(PUSH) * 12 / 240)
    assert (knee.start, knee.duration) == pytest.approx((40 / 240, 1 / 240))


def test_law_gains_and_their_changes_are_named(facts: BagFacts, fall: Eventful) -> None:
    (run,) = facts.runs
    knee = {row.joint: row for row in run.gains}["left_knee"]
    given = fall.plan.character.gains["left_knee"]
    (change,) = run.changes

    assert run.law == "stable_pd"
    assert (knee.p, knee.d, knee.limit) == (given.stiffness, given.damping, 150.0)
    assert (change.name, change.before, change.after) == ("gain_scale.p", 1.0, 2.0)
    assert change.time == pytest.approx(20 / 240)


def test_the_share_of_saturated_ticks_is_counted(tmp_path: Path) -> None:
    step: dict[str, object] = {"reference": "step", "step.size": 0.5, "step.time": 0.01}
    step["signal.dofs"] = ["panda_joint1", "panda_joint7"]
    made = make_run("franka_panda", 0.05, step)
    applied = np.array([state.effort for state in made.states[1:]])
    at_limit = np.isclose(np.abs(applied), made.plan.character.effort_limits(), rtol=1e-12)

    (run,) = look_at(write_bag(tmp_path / "bag", made.messages())).runs

    assert at_limit[:, 0].any() and not at_limit[:, 0].all()
    shares = [run.saturated_shares[name] for name in made.plan.character.vector_names]
    np.testing.assert_allclose(shares, at_limit.mean(axis=0))


def test_several_characters_are_described_each(pendulum: Made, tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        for namespace in ("left", "right"):
            add_to(bag, pendulum.messages(), namespace)

    facts = look_at(tmp_path)

    assert [stream.name for stream in facts.streams] == ["left", "right"]
    assert sorted(run.name for run in facts.runs) == ["left", "right"]


# What is broken or foreign


def test_missing_ticks_are_named_and_states_that_came_again_count_once(
    pendulum: Made, tmp_path: Path
) -> None:
    some = [state for row, state in enumerate(pendulum.states) if row not in (4, 5, 8)]
    twice = [*pendulum.states[:3], *pendulum.states[1:]]
    facts, others = (
        look_at(
            write_bag(
                tmp_path / f"{len(states)}",
                [raw_configuration(pendulum.plan), *raw_states(pendulum.plan, states)],
            )
        )
        for states in (some, twice)
    )

    (stream,), (again,) = facts.streams, others.streams
    assert stream.missing == [(5, 6), (9, 9)]  # ticks begin at 1
    assert stream.missing_count == 3
    assert stream.character == "pendulum"
    assert facts.runs == () and facts.lacks is not None and "5" in facts.lacks
    assert again.repeated == 2
    assert again.missing == [] and again.ticks == len(pendulum.states) - 1


def test_a_bag_of_something_else_has_its_topics(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    chatter = Topic("chatter", "std_msgs/msg/String", STREAM)
    raw = JointStateEncoder(["wheel"]).encode(5 * MS, np.zeros(1))
    messages = [
        (chatter, serialize_message(String(data="[bold]hello"))),
        (topics.JOINT_STATES, raw),
        (topics.JOINT_STATES, serialize_message(JointState())),
    ]
    bag = write_bag(tmp_path / "bag", messages)

    assert main(["info", str(bag)]) == 0

    output = capsys.readouterr().out
    assert "/chatter" in output and "std_msgs/msg/String" in output
    assert "sim_node/configuration" in output  # what is missing for more


@pytest.mark.parametrize("version", [4, 5, 9, 12])
def test_bags_of_other_versions_of_rosbag2_have_their_topics(tmp_path: Path, version: int) -> None:
    messages = [
        TextMessage("/a", 5_000, "1"),
        TextMessage("/b", 7_000, "2"),
        TextMessage("/a", 9_000, "3"),
    ]
    write_humble_db3(tmp_path / "bag_0.db3", messages)
    write_metadata(tmp_path, version, "sqlite3", ["bag_0.db3"], ["/a", "/b", "/c"])

    facts = look_at(tmp_path)

    assert facts.contents.version == version and facts.contents.storage == "sqlite3"
    counts = {topic.name: (topic.count, topic.largest_gap_ns) for topic in facts.contents.topics}
    assert counts == {"/a": (2, 4_000), "/b": (1, 0), "/c": (0, 0)}
    assert facts.streams == () and facts.lacks


@pytest.mark.parametrize(
    "reason",
    [
        "no JSON",
        "[]",
        '{"parameters": {"rate": "fast"}, "mass": []}',
        '{"parameters": {"rate": 1e400}, "mass": %s}' % 10**400,
        '{"parameters": {"rate": 0, "mode": "realtime", "real_time_factor": "x"}, "versions": 1}',
    ],
)
def test_a_configuration_of_somebody_else_does_no_harm(
    pendulum: Made, tmp_path: Path, reason: str
) -> None:
    configuration = topics.CONFIGURATION.of(topics.SIM_NODE)
    messages = [
        (configuration, serialize_message(String(data=reason))),
        *raw_states(pendulum.plan, pendulum.states),
    ]

    facts = look_at(write_bag(tmp_path / "bag", messages))

    assert facts.runs == () and facts.lacks
    assert facts.streams[0].ticks is None
    json.loads(as_json(facts))


def test_no_bag_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(RecordingError):
        look_at(tmp_path)

    assert main(["info", str(tmp_path / "nothing")]) == 1
    assert capsys.readouterr().err.count("\n") == 1


# Printed


def test_json_says_the_same(facts: BagFacts, fall: Eventful) -> None:
    content = json.loads(as_json(facts))

    topic = {topic["name"]: topic for topic in content["topics"]}["/joint_states"]
    assert topic["count"] == TICKS + 1
    assert topic["rate_sim_hz"] == pytest.approx((TICKS + 1) * 240 / TICKS)
    assert content["characters"][0]["missing"] == []
    assert content["runs"][0]["pushes"][0]["link"] == "chest"
    root = next(row for row in content["runs"][0]["gains"] if row["joint"] == "root")
    assert root["limit"] is None  # infinite, which JSON cannot say
    assert content["size_bytes"] == sum(content["files"].values())


def test_the_tables_are_printed(
    facts: BagFacts, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")

    assert main(["info", str(facts.contents.bag)]) == 0

    output = capsys.readouterr().out
    for words in (
        "humanoid, 34 degrees of freedom",
        "chest at 0.04167 s for 0.05 s",
        "gain_scale.p: 1.0 to 2.0 after 0.08333 s",
        "2 s of wall time",
        "missing ticks",
        "gains and limits in force",
    ):
        assert words in output


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "-"),
        (float("nan"), "-"),
        (0.123456, "0.1235"),
        (7, "7"),
        ({}, "none"),
        ({"left": 2, "right": 3}, "left: 2, right: 3"),
    ],
)
def test_a_table_has_a_dash_where_nothing_is_known(value: object, text: str) -> None:
    assert show(value) == text


# The wall clock


@pytest.mark.parametrize(
    ("period", "times", "late"),
    [
        (
            0.01,
            np.arange(8) * 0.01 + [0.0, 0.001, 0.0, 0.025, 0.015, 0.005, 0.0, 0.0],
            [0.0, 0.001, 0.0, 0.025, 0.015, 0.005, 0.0, 0.0],
        ),
        # after a long delay the schedule begins again
        (0.05, [0.0, 0.05, 0.10, 0.35, 0.40, 0.45], [0.0, 0.0, 0.0, 0.2, 0.0, 0.0]),
    ],
)
def test_ticks_are_late_by_the_schedule(
    period: float, times: list[float], late: list[float]
) -> None:
    published = START_NS + np.round(1e9 * np.array(times)).astype(np.intp)

    np.testing.assert_allclose(lateness(published, period), late, atol=1e-9)


@pytest.mark.parametrize("every", [12, 24, 48])
def test_what_takes_long_again_and_again_is_no_pause(every: int) -> None:
    steps = np.full(960, 0.003)
    steps[::every] = 0.4  # a planner
    steps[500] = 9.0
    published = START_NS + np.round(1e9 * np.cumsum(np.append(0.0, steps))).astype(np.intp)

    assert pauses(published).tolist() == [500]


def test_a_pause_makes_no_tick_late() -> None:
    times = np.concatenate((np.arange(10) * 0.01, 5.0 + np.arange(10) * 0.01))
    published = START_NS + np.round(1e9 * times).astype(np.intp)

    assert pauses(published).tolist() == [9]
    np.testing.assert_allclose(lateness(published, 0.01), 0.0, atol=1e-9)


def test_states_are_told_from_repetitions_at_any_rate() -> None:
    stamps = np.array([k * 10**9 // 240 for k in (1, 2, 2, 1, 3, 7)])

    times = state_times(stamps, np.arange(6), 240)

    assert times.ticks.tolist() == [1, 2, 3, 7]
    assert times.published_ns.tolist() == [0, 1, 4, 5]
    assert (times.repeated, times.missing, times.missing_count) == (2, [(4, 6)], 3)
