"""What `info` says of bags: of ours, of broken ones, of anybody's."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from actuated_characters.bags.writer import BagWriter
from actuated_characters.cli import main
from actuated_characters.commands.common.tables import show
from actuated_characters.report.contents import Contents, read_contents
from actuated_characters.report.events import CHANGE, FALL, PUSH, RESET
from actuated_characters.report.ticks import TickFacts, lateness, pauses, read_ticks
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
from tests.support.foreign_bags import (
    SENT,
    TextMessage,
    to_sqlite,
    write_humble_db3,
    write_mcap,
    write_metadata,
)

FORCE = (100.0, 0.0, 50.0)
TICKS = 60


@pytest.fixture(scope="module")
def fall() -> Eventful:
    """A humanoid in real time, pushed in two ticks, reset, paused."""
    return eventful_run(
        "humanoid",
        TICKS,
        pushed=[(10, 12, "chest", FORCE), (40, 1, "left_knee", FORCE)],
        reset_after=30,
        pause_after=50,
        tick_ns=4 * MS,
        mode="realtime",
    )


@pytest.fixture(scope="module")
def bag(fall: Eventful, tmp_path_factory: pytest.TempPathFactory) -> Path:
    messages = fall.messages()
    changed = {**fall.plan.controller, "gain_scale.p": 2.0}
    since = fall.states[20].stamp_ns
    configuration = raw_controller(fall.plan, changed, since)  # type: ignore[arg-type]
    messages.append((configuration, fall.log_times_ns[20]))
    messages.sort(key=lambda each: each[1])
    directory = tmp_path_factory.mktemp("fall")
    write_timed(directory / "bag", messages)
    return directory


@pytest.fixture(scope="module")
def contents(bag: Path) -> Contents:
    return read_contents(bag)


@pytest.fixture(scope="module")
def ticks(contents: Contents) -> TickFacts:
    (ticks,) = read_ticks(contents)[1]
    return ticks


def ticks_of(bag: Path) -> tuple[Contents, list[TickFacts]]:
    return read_ticks(read_contents(bag))


@pytest.fixture(scope="module")
def pendulum() -> Made:
    return make_run("pendulum", 0.05)


# Files and topics


def test_the_bag_and_its_topics_are_described(
    contents: Contents, fall: Eventful, bag: Path
) -> None:
    topic = {topic.name: topic for topic in contents.topics}["/joint_states"]
    wall_time = (fall.log_times_ns[-1] - contents.start_ns) / 1e9

    assert (topic.type, topic.count) == ("sensor_msgs/msg/JointState", TICKS + 1)
    assert contents.wall_time_s == pytest.approx(wall_time)
    assert contents.sim_time_s == pytest.approx(TICKS / 240)
    assert set(contents.files) == {"bag.mcap", "metadata.yaml"}
    assert contents.files["bag.mcap"] == (bag / "bag" / "bag.mcap").stat().st_size
    assert (contents.storage, contents.metadata_version) == ("mcap", 9)
    assert contents.start_ns == START_NS - 2 * MS


def test_the_largest_gap_between_messages_is_known_by_reading_them(
    contents: Contents, fall: Eventful
) -> None:
    whole, _ = read_ticks(contents)
    before, after = (
        {topic.name: topic for topic in each.topics}["/joint_states"] for each in (contents, whole)
    )

    assert before.largest_gap_s is None
    assert after.largest_gap_s == np.diff(fall.log_times_ns).max() / 1e9 == 2.004
    assert replace(after, largest_gap_s=None) == before
    assert (whole.start_ns, whole.wall_time_s) == (contents.start_ns, contents.wall_time_s)


def test_messages_are_not_read_to_be_counted(tmp_path: Path) -> None:
    file = write_mcap(tmp_path / "bag.mcap", SENT, compression=CompressionType.NONE)
    content = bytearray(file.read_bytes())
    content[content.index(b"text 15")] ^= 1
    file.write_bytes(content)

    contents = read_contents(file)

    assert {topic.name: topic.count for topic in contents.topics} == {"/a": 20, "/b": 10}
    with pytest.raises(RecordingError, match="it cannot be read whole"):
        read_ticks(contents)


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
    assert empty.count == 0
    assert contents.characters[0].states == len(pendulum.states)


# A character


def test_a_character_is_described(contents: Contents, fall: Eventful) -> None:
    (character,) = contents.characters
    knee = {row.joint: row for row in character.gains}["left_knee"]
    given = fall.plan.character.gains["left_knee"]

    assert (character.name, character.character) == ("", "humanoid")
    assert character.degrees_of_freedom == fall.plan.character.layout.size == 34
    assert character.mass == pytest.approx(fall.plan.character.mass)
    assert (character.rate_hz, character.mode) == (240, "realtime")
    assert character.states == TICKS + 1
    assert "pybullet" in character.versions
    assert character.law == "stable_pd"
    assert [row.joint for row in character.gains] == fall.plan.character.vector_names
    assert (knee.p, knee.d, knee.limit) == (given.stiffness, given.damping, 150.0)
    assert contents.lacks is None


def test_ticks_a_reset_and_a_pause_by_the_wall_clock_are_found(ticks: TickFacts) -> None:
    (pause,), (reset,) = ticks.pauses, (each for each in ticks.events if each.kind == RESET)

    assert (ticks.ticks, ticks.sim_time_s) == (TICKS, pytest.approx(TICKS / 240))
    assert (ticks.missing, ticks.missing_count, ticks.repeated) == ([], 0, 0)
    assert (reset.start, reset.duration) == pytest.approx((31 / 240, 29 / 240))
    assert (pause.start, pause.duration) == pytest.approx((50 / 240, 2.004))


def test_pushes_have_their_link_time_and_impulse(ticks: TickFacts) -> None:
    chest, knee = (each for each in ticks.events if each.kind == PUSH)

    assert (chest.facts["link"], knee.facts["link"]) == ("chest", "left_knee")
    assert (chest.start, chest.duration) == pytest.approx((10 / 240, 12 / 240))
    assert chest.facts["largest_force"] == pytest.approx(np.linalg.norm(FORCE))
    assert chest.facts["impulse"] == pytest.approx(np.linalg.norm(FORCE) * 12 / 240)
    assert (knee.start, knee.duration) == pytest.approx((40 / 240, 1 / 240))


def test_changes_of_parameters_are_named(ticks: TickFacts) -> None:
    (change,) = (each for each in ticks.events if each.kind == CHANGE)

    assert change.facts == {"name": "gain_scale.p", "before": 1.0, "after": 2.0}
    assert change.start == pytest.approx(20 / 240)


def test_a_fall_is_told(tmp_path: Path) -> None:
    made = make_run("humanoid", 0.4)
    fallen = made.states[0].position.copy()
    fallen[2] = 0.3
    states = [replace(each, position=fallen) for each in made.states]
    messages = [raw_configuration(made.plan), *raw_states(made.plan, states)]

    _, (facts,) = ticks_of(write_bag(tmp_path / "bag", messages))

    assert [each.text for each in facts.events if each.kind == FALL] == ["it fell"]
    assert facts.absent == ["reference", "contacts", "pushes"]


def test_the_share_of_saturated_ticks_is_counted(tmp_path: Path) -> None:
    step: dict[str, object] = {"reference": "step", "step.size": 0.5, "step.time": 0.01}
    step["signal.dofs"] = ["panda_joint1", "panda_joint7"]
    made = make_run("franka_panda", 0.05, step)
    applied = np.array([state.effort for state in made.states[1:]])
    at_limit = np.isclose(np.abs(applied), made.plan.character.effort_limits(), rtol=1e-12)

    _, (facts,) = ticks_of(write_bag(tmp_path / "bag", made.messages()))

    assert at_limit[:, 0].any() and not at_limit[:, 0].all()
    shares = [facts.saturated_shares[name] for name in made.plan.character.vector_names]
    np.testing.assert_allclose(shares, at_limit.mean(axis=0))


def test_several_characters_are_described_each(pendulum: Made, tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        for namespace in ("left", "right"):
            add_to(bag, pendulum.messages(), namespace)

    contents, ticks = ticks_of(tmp_path)

    assert [character.name for character in contents.characters] == ["left", "right"]
    assert sorted(facts.name for facts in ticks) == ["left", "right"]


# What is broken or foreign


def test_missing_ticks_are_named_and_states_that_came_again_count_once(
    pendulum: Made, tmp_path: Path
) -> None:
    some = [state for row, state in enumerate(pendulum.states) if row not in (4, 5, 8)]
    twice = [*pendulum.states[:3], *pendulum.states[1:]]
    both = (
        ticks_of(
            write_bag(
                tmp_path / f"{len(states)}",
                [raw_configuration(pendulum.plan), *raw_states(pendulum.plan, states)],
            )
        )
        for states in (some, twice)
    )

    (contents, (facts,)), (_, (again,)) = both
    assert facts.missing == [(5, 6), (9, 9)]  # ticks begin at 1
    assert facts.missing_count == 3 and facts.ticks == len(pendulum.states) - 1
    assert contents.characters[0].character == "pendulum"
    assert not facts.events and not facts.saturated_shares
    assert contents.lacks is not None and "ticks 5 to 6, 9 are missing" in contents.lacks
    assert again.repeated == 2
    assert again.missing == [] and again.ticks == len(pendulum.states) - 1


@pytest.mark.parametrize("options", [(), ("--ticks",)])
def test_a_bag_of_something_else_has_its_topics(
    options: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    chatter = Topic("chatter", "std_msgs/msg/String", STREAM)
    raw = JointStateEncoder(["wheel"]).encode(5 * MS, np.zeros(1))
    messages = [
        (chatter, serialize_message(String(data="[bold]hello"))),
        (topics.JOINT_STATES, raw),
        (topics.JOINT_STATES, serialize_message(JointState())),
    ]
    bag = write_bag(tmp_path / "bag", messages)

    assert main(["info", str(bag), *options]) == 0

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

    contents, ticks = ticks_of(tmp_path)

    assert contents.metadata_version == version and contents.storage == "sqlite3"
    counts = {topic.name: (topic.count, topic.largest_gap_s) for topic in contents.topics}
    assert counts == {"/a": (2, 4e-6), "/b": (1, None), "/c": (0, None)}
    assert ticks == [] and contents.characters == () and contents.lacks


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

    contents, ticks = ticks_of(write_bag(tmp_path / "bag", messages))

    assert contents.characters == () and contents.lacks and ticks == []


def test_no_bag_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(RecordingError):
        read_contents(tmp_path)

    assert main(["info", str(tmp_path / "nothing")]) == 1
    assert capsys.readouterr().err.count("\n") == 1


# Printed


def test_json_says_the_same(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(bag), "--json"]) == 0
    content = json.loads(capsys.readouterr().out)

    topic = {topic["name"]: topic for topic in content["topics"]}["/joint_states"]
    assert topic["count"] == TICKS + 1
    root = next(row for row in content["characters"][0]["gains"] if row["joint"] == "root")
    assert root["limit"] is None  # infinite, which JSON cannot say
    assert content["size_bytes"] == sum(content["files"].values())
    assert content["runs"] is None

    assert main(["info", str(bag), "--json", "--ticks"]) == 0
    (run,) = json.loads(capsys.readouterr().out)["runs"]
    assert run["missing"] == []
    assert run["events"][0]["facts"]["link"] == "chest"


def test_the_tables_are_printed(
    bag: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    known = ("humanoid, 34 degrees of freedom", "about 0.25 s", "gains and limits in force")
    read = (
        "at 0.04167 s: push on chest for 0.05 s",
        "at 0.08333 s: gain_scale.p: 1 to 2",
        "2 s of wall time",
        "missing ticks",
    )

    assert main(["info", str(bag)]) == 0
    output = capsys.readouterr().out
    assert [each for each in (*known, *read) if each in output] == list(known)
    assert main(["info", str(bag), "--ticks"]) == 0
    output = capsys.readouterr().out
    assert [each for each in (*known[::2], *read) if each in output] == [*known[::2], *read]


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
