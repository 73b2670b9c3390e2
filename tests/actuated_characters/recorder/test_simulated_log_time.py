"""Runs of real nodes whose bags have simulated log times: players see 1 s as 1 s, replays agree."""

import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from actuated_characters.bags.reader import read_messages
from actuated_characters.bags.recording import read_recording
from actuated_characters.cli import main
from actuated_characters.metrics.recording_metrics import measure_recording
from actuated_characters.recorder.recovery import recover
from actuated_characters.report.contents import read_contents
from actuated_characters.report.ticks import read_ticks
from msgs_config.messages.clock import TickClock
from tests.actuated_characters.bags.format.test_mcap_writing import unclosed
from tests.support.foreign_bags import to_sqlite
from tests.support.ros import Processes

pytestmark = [pytest.mark.slow, pytest.mark.sharing]

TICKS = 240  # of 240 Hz
CLOCK = TickClock(240)
FIRST_NS, LAST_NS = CLOCK.stamp_ns(1), CLOCK.stamp_ns(TICKS + 1)
EACH_STORAGE = pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
UNSTAMPED = {"/sim_node/configuration", "/controller_node/configuration", "/controller_node/mode"}
OF_WALL_CLOCK = {"/diagnostics"}


@pytest.fixture(scope="module")
def started(domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Processes]:
    del domain
    started = Processes(tmp_path_factory.mktemp("processes"))
    yield started
    started.end()


@pytest.fixture(scope="module")
def runs(started: Processes, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A second of a pushed walk with simulated log times, also as SQLite, and with wall times."""
    directory, found = tmp_path_factory.mktemp("runs"), {}
    for name, log_time, way in (("mcap", "simulated", ()), ("wall", "wall", ("--in-process",))):
        process = started.command(
            *("run", "--clip", "walk", "--duration", "1", "--push=chest:200,50,0@0.3"),
            *("--log-time", log_time, *way),
            *("--output", str(directory / name)),
        )
        assert process.wait(120.0) == 0, process.stderr
        found[name] = directory / name
    shutil.copytree(found["mcap"], directory / "sqlite3", ignore=shutil.ignore_patterns("bag"))
    to_sqlite(found["mcap"] / "bag", directory / "sqlite3" / "bag")
    return {**found, "sqlite3": directory / "sqlite3"}


def summary_of(run: Path) -> dict[str, Any]:
    return dict(json.loads((run / "summary.json").read_text()))


def stamp_of(message: Any) -> int | None:
    """The stamp of a message as another library has decoded it."""
    if hasattr(message, "clock"):
        stamp = message.clock
    elif hasattr(message, "markers"):
        stamp = message.markers[0].header.stamp
    else:
        stamp = getattr(getattr(message, "header", message), "stamp", None)
    return None if stamp is None else stamp.sec * 10**9 + stamp.nanosec


@EACH_STORAGE
def test_log_times_are_the_stamps_to_an_independent_reader(
    runs: dict[str, Path], storage: str
) -> None:
    topics = set()
    with AnyReader([runs[storage] / "bag"]) as reader:
        assert (reader.start_time, reader.end_time - 1) == (FIRST_NS, LAST_NS)
        for connection, log_time_ns, raw in reader.messages():
            topics.add(connection.topic)
            assert FIRST_NS <= log_time_ns <= LAST_NS
            if connection.topic not in UNSTAMPED | OF_WALL_CLOCK:
                stamp_ns = stamp_of(reader.deserialize(raw, connection.msgtype))
                assert log_time_ns == max(stamp_ns or 0, FIRST_NS), connection.topic
    assert topics > UNSTAMPED | OF_WALL_CLOCK | {"/joint_states", "/clock", "/visualization"}


@EACH_STORAGE
def test_a_second_lasts_a_second(runs: dict[str, Path], storage: str) -> None:
    content = yaml.safe_load((runs[storage] / "bag" / "metadata.yaml").read_text())
    information = content["rosbag2_bagfile_information"]

    assert information["duration"] == {"nanoseconds": LAST_NS - FIRST_NS}
    assert information["starting_time"] == {"nanoseconds_since_epoch": FIRST_NS}
    assert information["custom_data"] == {"log_time": "simulated"}


def test_times_of_publishing_stay_those_of_the_wall_clock(runs: dict[str, Path]) -> None:
    written = (runs["mcap"] / "bag" / "metadata.yaml").stat().st_mtime_ns
    numbers: dict[int, list[int]] = {}
    with (runs["mcap"] / "bag" / "bag.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        for _, _, message in reader.iter_messages(log_time_order=False):
            assert 0 <= written - message.publish_time < 120 * 10**9
            numbers.setdefault(message.channel_id, []).append(message.sequence)
    assert all(found == list(range(1, len(found) + 1)) for found in numbers.values())


@EACH_STORAGE
def test_messages_of_equal_log_time_are_in_the_order_of_their_publishing(
    runs: dict[str, Path], storage: str
) -> None:
    """Simulator and controller alternate: state, answer, and what the tick did before its state."""
    seen: dict[int, list[str]] = {}
    bag = runs[storage] / "bag"
    for message in read_messages(bag, ["/contacts", "/joint_states", "/joint_torques"]):
        if message.log_time_ns > FIRST_NS:  # the first state is published until it is answered
            seen.setdefault(message.log_time_ns, []).append(message.topic)

    orders = [list(dict.fromkeys(each)) for each in seen.values()]  # a late answer: a state again
    assert len(orders) == TICKS
    assert all(each == ["/contacts", "/joint_states", "/joint_torques"] for each in orders[:-1])
    assert orders[-1][:2] == ["/contacts", "/joint_states"]


@EACH_STORAGE
def test_the_run_is_the_same_to_all_who_read_it(
    runs: dict[str, Path], storage: str, capsys: pytest.CaptureFixture[str]
) -> None:
    run, wall = runs[storage], runs["wall"]
    state_hash = summary_of(wall)["state_hash"]
    assert summary_of(run)["state_hash"] == state_hash
    of_wall_clock = {"wall_time_s", "real_time_factor"}
    known = {k: v for k, v in summary_of(run).items() if k not in of_wall_clock}
    assert known == {k: v for k, v in summary_of(wall).items() if k not in of_wall_clock}

    assert main(["replay", str(run)]) == 0
    assert f"identical: {TICKS + 1} states of humanoid, 1 episode, state hash {state_hash}" in (
        capsys.readouterr().out
    )
    assert main(["compare", str(wall), str(run)]) == 0
    assert "identical" in capsys.readouterr().out
    tables = []
    for each in (wall, run):
        table = each / "states.csv"
        assert main(["export", str(each), "--output", str(table), "--overwrite"]) == 0
        tables.append(table.read_bytes())
    assert tables[0] == tables[1]


@pytest.mark.nightly
@EACH_STORAGE
def test_players_in_the_place_of_either_node_get_the_same(
    runs: dict[str, Path], storage: str, capsys: pytest.CaptureFixture[str]
) -> None:
    run = str(runs[storage])

    assert main(["replay", run, "--through-topics"]) == 0
    assert f"identical: {TICKS + 1} states of humanoid" in capsys.readouterr().out
    assert main(["replay", run, "--through-topics", "simulator"]) == 0
    assert re.match(r"identical: the commands that answer 24[01] states", capsys.readouterr().out)


def test_wall_times_of_a_run_are_known_from_mcap(runs: dict[str, Path]) -> None:
    factor = summary_of(runs["mcap"])["real_time_factor"]
    recording = read_recording(runs["mcap"])
    metrics, _ = measure_recording(recording)
    contents = read_contents(runs["mcap"])
    whole, (ticks,) = read_ticks(contents)

    assert recording.has_wall_times
    # the recorder's begins with the first answer, and that of a recording with the first state
    assert 0.0 < metrics["real_time_factor"] <= factor  # type: ignore[operator]
    assert ticks.tick_us and whole.wall_time_s is not None
    assert whole.start_ns is not None and whole.start_ns > 10**18
    assert (contents.start_ns, contents.wall_time_s) == (None, None)  # these are known by reading


def test_wall_times_that_sqlite_cannot_hold_are_not_invented(
    runs: dict[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    run = runs["sqlite3"]
    recording = read_recording(run)
    metrics, _ = measure_recording(recording)

    assert not recording.has_wall_times
    assert metrics["wall_time_s"] is None and metrics["real_time_factor"] is None
    contents, (ticks,) = read_ticks(read_contents(run))
    assert not ticks.tick_us and not ticks.pauses and not ticks.late
    assert (contents.wall_time_s, contents.start_ns) == (None, None)
    assert {topic.largest_gap_s for topic in contents.topics} == {None}
    assert main(["info", str(run)]) == 0
    assert "unknown, log times are simulated" in capsys.readouterr().out


def test_a_recovered_bag_is_measured_as_before(runs: dict[str, Path], tmp_path: Path) -> None:
    run = shutil.copytree(runs["mcap"], tmp_path / "run")
    before, sound = summary_of(run), list(read_messages(run / "bag"))
    (run / "summary.json").unlink()
    unclosed(run / "bag")

    recover(run)

    assert list(read_messages(run / "bag")) == sound
    after = summary_of(run)
    assert {k: after[k] for k in before if k in after} == {k: before[k] for k in after}
