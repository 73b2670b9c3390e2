"""Recovering: what was flushed is in the new bag, whatever became of its writer."""

import json
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosbags.highlevel import AnyReader

from actuated_characters import cli
from actuated_characters.bags.format.definitions import read_definition
from actuated_characters.bags.reader import read_messages
from actuated_characters.bags.writer import BagWriter
from actuated_characters.metrics.collector import MetricsCollector
from actuated_characters.recorder.recovery import recover
from actuated_characters.recorder.run_directory import SUMMARY, read_metrics, write_metrics
from msgs_config.errors import RecordingError
from tests.support.bags import add_to, make_run
from tests.support.foreign_bags import SENT, texts
from tests.support.limits import file_size_limit, unprivileged
from tests.support.ros import Process, wait_until

pytestmark = pytest.mark.slow

QOS = QoSProfile(depth=5000)
LATCHED_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
COMPRESSIONS = ("none", "zstd")
EACH_COMPRESSION = pytest.mark.parametrize("compression", COMPRESSIONS)

# A recorder at its simplest: says what it has flushed, until it is killed.
WRITER = """
import sys
from pathlib import Path
import numpy as np
from rclpy.qos import QoSProfile
from std_msgs.msg import String
from actuated_characters.bags.writer import BagWriter
rng = np.random.default_rng(int(sys.argv[3]))
bag = BagWriter(Path(sys.argv[1]), compression=sys.argv[2])
bag.add_topic("/text", "std_msgs/msg/String", QoSProfile(depth=10))
number = 0
while True:
    for _ in range(int(rng.integers(1, 2000))):
        number += 1
        raw = number.to_bytes(8, "little") + rng.bytes(int(rng.integers(2000)))
        bag.write("/text", raw, number)
    bag.flush()
    print("flushed", number, flush=True)
"""


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    (tmp_path / "bag").mkdir()
    return tmp_path / "bag"


def unclosed(bag: Path, compression: str = "none") -> BagWriter:
    """A bag with SAID flushed, and five messages more that were not."""
    writer = BagWriter(bag, compression=compression)
    for topic in ("/a", "/b"):
        writer.add_topic(topic, "std_msgs/msg/String", LATCHED_QOS if topic == "/b" else QOS)
    for sent in SENT:
        writer.write(sent.topic, sent.cdr, sent.log_time_ns)
    writer.flush()
    for number in range(5):
        writer.write("/a", SENT[1].cdr, 100 + number)
    return writer


def killed(tmp_path: Path, compression: str = "none") -> Path:
    """A bag as it is on the disk while its writer is still at work: as a kill leaves it."""
    writer = unclosed(tmp_path / "alive" / "bag", compression)
    return leave(writer, tmp_path / "bag")


def leave(writer: BagWriter, bag: Path) -> Path:
    """Copy a bag as a kill of its writer would leave it, and close it."""
    shutil.copytree(writer.path, bag)
    writer.close()
    return bag


# Killed


@pytest.mark.parametrize(("compression", "seed"), [("none", 1), ("none", 2), ("zstd", 1)])
def test_a_killed_recorder_loses_nothing_that_it_flushed(
    tmp_path: Path, compression: str, seed: int
) -> None:
    bag = tmp_path / "bag"
    enough = int(np.random.default_rng(seed).integers(1, 8))
    child = Process(["-c", WRITER, str(bag), compression, str(seed)], tmp_path / "child")
    try:
        wait_until(lambda: child.stdout.count("\n") > enough, "flushes")
        child.send(signal.SIGKILL)
        child.wait()
    finally:
        child.end()
    flushed = int(child.stdout.rpartition("\n")[0].split()[-1])

    recovered = recover(bag)

    numbers = [int.from_bytes(message.raw[:8], "little") for message in read_messages(bag)]
    assert numbers == list(range(1, len(numbers) + 1))
    assert len(numbers) >= flushed
    assert recovered.contents.counts == {"/text": len(numbers)}
    assert recovered.contents.last_log_time_ns == len(numbers)
    assert_others_read_it(bag, len(numbers))


def assert_others_read_it(bag: Path, count: int) -> None:
    with AnyReader([bag]) as reader:
        assert sum(1 for _ in reader.messages()) == count
    for file in bag.glob("*.mcap"):
        with file.open("rb") as stream:
            assert sum(1 for _ in make_reader(stream, validate_crcs=True).iter_messages()) == count


@EACH_COMPRESSION
def test_all_that_was_flushed_is_recovered_with_type_hash_and_qos(
    tmp_path: Path, compression: str
) -> None:
    bag = killed(tmp_path, compression)
    before = {file.name: file.read_bytes() for file in bag.iterdir()}

    recovered = recover(bag)

    assert texts(bag) == SENT
    assert recovered.contents.counts == {"/a": 20, "/b": 10}
    assert recovered.damaged == tmp_path / "bag.damaged"
    after = {file.name: file.read_bytes() for file in (tmp_path / "bag.damaged").iterdir()}
    assert after == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["alive", "bag", "bag.damaged"]
    whole = (tmp_path / "alive" / "bag" / "bag.mcap").stat().st_size
    assert (bag / "bag.mcap").stat().st_size == pytest.approx(whole, rel=0.2)  # compressed likewise
    definition = read_definition("std_msgs/msg/String")
    with AnyReader([bag]) as new, AnyReader([tmp_path / "alive" / "bag"]) as old:
        assert [c.digest for c in new.connections] == [definition.type_hash] * 2
        assert {c.topic: (c.ext, c.msgdef, c.msgtype) for c in new.connections} == {
            c.topic: (c.ext, c.msgdef, c.msgtype) for c in old.connections
        }


def test_a_recorder_that_was_killed_before_its_first_flush_leaves_nothing_to_recover(
    tmp_path: Path,
) -> None:
    writer = BagWriter(tmp_path / "alive" / "bag")
    writer.add_topic("/a", "std_msgs/msg/String", QOS)
    leave(writer, tmp_path / "run" / "bag")

    with pytest.raises(RecordingError, match=r"nothing to recover in .*: no message reached the d"):
        recover(tmp_path / "run" / "bag")

    assert [path.name for path in (tmp_path / "run").iterdir()] == ["bag"]


@EACH_COMPRESSION
def test_a_bag_whose_recorder_is_still_at_work_is_left_to_it(
    tmp_path: Path, compression: str
) -> None:
    writer = unclosed(tmp_path / "bag", compression)
    with pytest.raises(RecordingError, match=r"a recorder is still at work on .*; end it"):
        recover(tmp_path / "bag")

    writer.close()

    assert len(texts(tmp_path / "bag")) == len(SENT) + 5
    assert [path.name for path in tmp_path.iterdir()] == ["bag"]


def test_a_file_that_was_being_compressed_is_read_once(tmp_path: Path) -> None:
    bag = killed(tmp_path)
    (bag / "bag.mcap.zstd").write_bytes(b"begun")

    recovered = recover(bag)

    assert texts(bag) == SENT and recovered.contents.unreadable == []


def test_topics_without_messages_are_kept(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "alive" / "bag")
    for topic in ("/a", "/silent"):
        writer.add_topic(topic, "std_msgs/msg/String", QOS)
    writer.write("/a", SENT[1].cdr, 1)
    writer.flush()

    recover(leave(writer, tmp_path / "bag"))

    assert list(read_messages(tmp_path / "bag", ["/silent"])) == []
    assert len(list(read_messages(tmp_path / "bag", ["/a"]))) == 1


# What is left alone


def test_files_of_several_recordings_are_not_mixed(tmp_path: Path) -> None:
    bag = killed(tmp_path)
    shutil.copy(bag / "bag.mcap", bag / "other.mcap")

    with pytest.raises(RecordingError, match=r"\(bag.mcap, other.mcap\) are not those of one rec"):
        recover(bag)

    (bag / "other.mcap").rename(bag / "bag_1.mcap")
    assert recover(bag).contents.counts == {"/a": 40, "/b": 20}


def test_a_bag_that_another_recorder_writes_is_left_to_it(tmp_path: Path) -> None:
    """One that makes no claim, as ROS' own."""
    bag = killed(tmp_path)
    program = (
        f"import time; file = open({str(bag / 'bag.mcap')!r}, 'ab'); print('open', flush=True)"
    )
    child = Process(["-c", f"{program}; time.sleep(60)"], tmp_path / "child")
    try:
        wait_until(lambda: "open" in child.stdout, "the file to be open")
        with pytest.raises(
            RecordingError, match=r"process \d+ is still writing to .*; end it first"
        ):
            recover(bag)
        child.send(signal.SIGKILL)
        child.wait()
    finally:
        child.end()

    with (bag / "bag.mcap").open("rb"):  # who reads does no harm
        recover(bag)
    assert texts(bag) == SENT


def snapshot(bag: Path) -> dict[str, tuple[int, bytes]]:
    return {file.name: (file.stat().st_mtime_ns, file.read_bytes()) for file in bag.iterdir()}


def test_a_complete_bag_is_not_touched(tmp_path: Path) -> None:
    unclosed(tmp_path / "bag").close()
    before = snapshot(tmp_path / "bag")

    recovered = recover(tmp_path / "bag")

    assert recovered.damaged is None
    assert recovered.contents.counts.total() == len(SENT) + 5
    assert snapshot(tmp_path / "bag") == before
    assert [path.name for path in tmp_path.iterdir()] == ["bag"]


def test_where_there_is_nothing_the_error_says_so(tmp_path: Path, bag: Path) -> None:
    with pytest.raises(RecordingError, match=r"nothing to recover: .*nowhere is no directory$"):
        recover(tmp_path / "nowhere")
    with pytest.raises(RecordingError, match=r"nothing to recover in .*: it has no .mcap file"):
        recover(bag)
    (bag / "bag_0.mcap").write_bytes(b"garbage")
    with pytest.raises(RecordingError, match=r"no message reached the disk .*is no MCAP file"):
        recover(bag)
    with pytest.raises(RecordingError, match="give the directory that it lies in"):
        recover(bag / "bag_0.mcap")


def test_an_earlier_original_is_not_overwritten(tmp_path: Path) -> None:
    bag = killed(tmp_path)
    (tmp_path / "bag.damaged").mkdir()

    with pytest.raises(RecordingError, match=r"bag.damaged is in the way: .*; move it"):
        recover(bag)

    assert not list((tmp_path / "bag.damaged").iterdir())


def test_a_full_disk_leaves_the_damaged_bag_as_it_was(tmp_path: Path) -> None:
    bag = killed(tmp_path)
    before = snapshot(bag)

    with file_size_limit(1000), pytest.raises(RecordingError, match="cannot write: File too large"):
        recover(bag)

    assert snapshot(bag) == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["alive", "bag"]


def test_a_directory_without_permission_is_one_clear_error(tmp_path: Path) -> None:
    bag = killed(tmp_path)
    tmp_path.chmod(0o555)
    with unprivileged(), pytest.raises(RecordingError, match=r"cannot recover .*: Permission deni"):
        recover(bag)


@pytest.mark.parametrize("step", [1, 2])
def test_a_recovery_that_is_killed_between_its_renames_is_finished_by_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: int
) -> None:
    bag = killed(tmp_path)
    rename, done = Path.rename, list[Path]()

    def rename_once(self: Path, target: Path) -> Path:
        if self.name == "bag" and len(done) == step - 1:
            raise KeyboardInterrupt
        done.append(self)
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", rename_once)
    with pytest.raises(KeyboardInterrupt):
        recover(bag)
    monkeypatch.undo()
    assert bag.exists() == (step == 1)

    recover(bag)

    assert texts(bag) == SENT
    assert sorted(path.name for path in tmp_path.iterdir()) == ["alive", "bag", "bag.damaged"]


# Runs


def run_directory(tmp_path: Path) -> Path:
    """A run's directory with a bag that lacks its end, as the recorder left it when killed."""
    made = make_run("pendulum", 0.5)
    writer = BagWriter(tmp_path / "alive" / "bag")
    add_to(writer, made.messages())
    writer.flush()
    leave(writer, tmp_path / "run" / "bag")
    (tmp_path / "run" / "logs").mkdir()
    return tmp_path / "run"


def test_a_run_gets_its_figures_again(tmp_path: Path) -> None:
    run = run_directory(tmp_path)

    recovered = recover(run)

    collector = MetricsCollector()
    for message in read_messages(tmp_path / "alive" / "bag"):
        collector.take(message.topic.removeprefix("/"), message.raw, message.log_time_ns)
    expected, expected_series = collector.results()
    write_metrics(tmp_path / "expected", expected, expected_series)
    assert recovered.measured == [run]
    for found, same in zip(read_metrics(run), read_metrics(tmp_path / "expected"), strict=True):
        np.testing.assert_equal(found, same)
    assert read_metrics(run)[0]["ticks"] == 120


def test_each_of_several_characters_gets_figures_of_its_own(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "alive" / "bag")
    for name, duration in (("left", 0.25), ("right", 0.5)):
        add_to(writer, make_run("pendulum", duration).messages(), f"world/{name}")
    writer.flush()
    leave(writer, tmp_path / "run" / "bag")

    recovered = recover(tmp_path / "run")

    assert recovered.measured == [tmp_path / "run" / "left", tmp_path / "run" / "right"]
    ticks = [read_metrics(directory)[0]["ticks"] for directory in recovered.measured]
    assert ticks == [60, 120]


def test_figures_of_the_whole_run_are_kept(tmp_path: Path) -> None:
    """A recorder whose disk is full measures on."""
    run = run_directory(tmp_path)
    (run / SUMMARY).write_text("of the whole run")

    recovered = recover(run)

    assert (recovered.measured, recovered.unchanged) == ([], [run])
    assert (run / SUMMARY).read_text() == "of the whole run"


def test_a_complete_bag_without_figures_gets_them(tmp_path: Path) -> None:
    run_directory(tmp_path)

    recovered = recover(tmp_path / "alive")

    assert recovered.damaged is None
    assert read_metrics(tmp_path / "alive")[0]["ticks"] == 120
    assert recover(tmp_path / "alive").measured == []


def test_a_run_of_something_else_is_recovered_without_figures(tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir()
    shutil.move(killed(tmp_path), run)

    recovered = recover(run)

    assert texts(run / "bag") == SENT
    assert recovered.measured == []
    assert "sim_node/configuration" in recovered.unmeasured


# The command


@pytest.fixture
def quiet_signals() -> Iterator[None]:
    """The command line sets handlers; they go back to the test's own."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in handlers.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("quiet_signals")
def test_the_command_says_what_it_recovered_and_where_the_damaged_bag_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = run_directory(tmp_path)

    assert cli.main(["info", str(run), "--recover"]) == 0

    output = capsys.readouterr()
    assert "/joint_states" in output.out
    printed = output.err.replace("\n", " ")
    assert f"{run / 'bag'}: 242 messages, the last one of 1970-01-01 00:00:00.001000 UTC" in printed
    assert f"the damaged bag: {run / 'bag.damaged'}" in printed
    assert f"figures: {run}" in printed
    assert cli.main(["info", str(run), "--recover", "--json"]) == 0
    output = capsys.readouterr()
    assert "is complete (242 messages): nothing to recover" in output.err
    assert json.loads(output.out)["bag"] == str(run / "bag")


@pytest.mark.usefixtures("quiet_signals")
def test_the_command_says_in_one_line_what_is_wrong(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["info", str(tmp_path), "--recover"]) == 1

    assert capsys.readouterr().err.splitlines()[-1].startswith("error: nothing to recover in ")
