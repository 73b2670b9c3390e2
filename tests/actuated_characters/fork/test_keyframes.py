"""A fork from a keyframe goes on as the whole run does, whatever simulator and controller remember.

Runs of one process, with keyframes half a second apart. The oracle is the recorded run itself.
"""

import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from actuated_characters.bags.format.metadata import BAG
from actuated_characters.bags.keyframes import find_keyframes
from actuated_characters.bags.reader import RecordedMessage, read_messages
from actuated_characters.bags.recording import Recording, read_recording, read_recordings
from actuated_characters.bags.writer import BagWriter
from actuated_characters.cli import main
from actuated_characters.fork.plan import ForkInputs, plan_fork
from actuated_characters.replay.replay import replay
from msgs_config import memory
from msgs_config.messages.cdr import decode_header
from msgs_config.messages.keyframe import Keyframe, decode_keyframe, encode_keyframe
from msgs_config.messages.topic import Quality
from tests.support.physics import character
from tests.support.policies import write_random_policy
from tests.support.rewriting import rewrite
from tests.support.runs import summary_of

pytestmark = pytest.mark.slow

EVERY = (
    *("--set", "sim_node.keyframe_period:=0.5"),
    *("--set", "sim_node.keyframe_budget:=100000"),  # else large ones come rarely
)
WALK = ("--clip", "walk")
PUSH = ("--push", "chest:0,100,0@0.3")
QUICK = ("--planner", "predictive", "--set", "controller_node.plan.samples:=8")
MUJOCO = ("--set", "sim_node.engine:=mujoco", "--set", "sim_node.substeps:=2")
POLICY = "controller_node.policy:="  # and a file, of `make`
BY_POLICY = (*WALK, *PUSH, "--planner", "policy", "--set", POLICY)
BALL = ("--throw", "mass=4 speed=8 at=0.5 target=chest")


def of_controller(*settings: str) -> list[str]:
    """The options that set parameters of the controller."""
    return [part for each in settings for part in ("--set", f"controller_node.{each}")]


KINDS: dict[str, tuple[str, ...]] = {
    "late": ("--character", "pendulum", "--set", "sim_node.command_delay_ticks:=3"),
    "clip": (*WALK, *PUSH),
    "substeps": (*WALK, "--set", "sim_node.substeps:=2"),
    "hit": (*WALK, *PUSH, *BALL, *of_controller("behaviour:=reactive")),
    "limp": (*WALK, "--push", "chest:0,900,0@0.2", *of_controller("behaviour:=active_ragdoll")),
    "machine": ("--machine", "walk", *PUSH, "--cmd-vel", "0.6,0,0.2@0.1"),
    "other engine": (*WALK, *PUSH, *BALL, *of_controller("behaviour:=reactive"), *MUJOCO),
    "other engine, limp": (*of_controller("behaviour:=ragdoll"), *WALK, *PUSH, *MUJOCO),
    "integral": ("--character", "pendulum", *of_controller("law:=pid", "gains.hinge.i:=50.0")),
    "balance": of_controller("balance.enabled:=true", "root_assistance:=false"),
    "steered": (*of_controller("reference:=steered"), "--cmd-vel", "0.6,0,0.2@0.1"),
    "planned": (*WALK, *PUSH, *QUICK),
    "policy": BY_POLICY,
    "policy, other engine": (*BY_POLICY, *MUJOCO, "--set", "sim_node.command_delay_ticks:=2"),
    "planned, late": (
        *WALK,
        *QUICK,
        *("--set", "sim_node.command_delay_ticks:=2"),
        *of_controller("planning_delay_ticks:=6"),
    ),
}

# Those that take longer than another one of the same code.
LONGER = {"other engine, limp", "planned", "policy, other engine", "substeps"}


@pytest.fixture(scope="module")
def make(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Makes a run of 0.8 s."""
    folder = tmp_path_factory.mktemp("keyframes")
    policy = write_random_policy(folder / "policy.npz", character("humanoid"))

    def made(name: str, *options: str) -> Path:
        run = folder / name
        if not run.exists():
            given = (f"{POLICY}{policy}" if each == POLICY else each for each in options)
            options = (*EVERY, *given, "--duration", "0.8")
            assert main(["run", "--in-process", *options, "--output", str(run)]) == 0
        return run

    return made


@pytest.fixture(scope="module")
def walk(make: Callable[..., Path]) -> Path:
    return make("walk", *WALK, *PUSH)


def fork(run: Path, name: str, *options: str, at: str = "0.7") -> Path:
    """A fork of a run."""
    output = run.with_name(name)
    assert main(["fork", str(run), "--at", at, *options, "--output", str(output)]) == 0
    return output


def with_changed(run: Path, target: Path, topic: str, change: Callable[[bytes], bytes]) -> None:
    """Copy a run's bag with the messages of a topic as `change` makes them."""
    target.mkdir()
    rewrite(run / BAG, target / BAG, lambda m: change(m.raw) if m.topic == topic else m.raw)


def assert_ends_alike(part: Recording, whole: Recording) -> None:
    """The states and efforts of a part are the last ones of the whole, to the bit."""
    count = len(part.stamps_ns)
    assert part.stamps_ns.tolist() == whole.stamps_ns[-count:].tolist()
    for name in ("position", "velocity", "reference_position"):
        assert getattr(part, name).tobytes() == getattr(whole, name)[-count:].tobytes(), name
    assert part.effort.tobytes() == whole.effort[1 - count :].tobytes()


@pytest.mark.parametrize(
    "kind",
    [pytest.param(kind, marks=pytest.mark.nightly if kind in LONGER else []) for kind in KINDS],
)
def test_a_fork_from_a_keyframe_ends_as_the_run_did(
    make: Callable[..., Path], kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    run = make(kind, *KINDS[kind])
    whole, part = read_recording(run), read_recording(fork(run, f"{kind}-fork"))
    assert len(part.stamps_ns) == round(0.3 * 240) + 1  # from 0.5 s on
    assert_ends_alike(part, whole)
    assert replay([part]).identical
    assert replay([whole]).identical


def test_new_inputs_count_as_in_a_fork_from_the_start(
    walk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    new = ("--push", "chest:150,0,0@0.72", "--throw", "mass=2 speed=40 at=0.78 target=chest")
    new += ("--set", "controller_node.gain_scale.p:=0.5", "--duration", "1.1")
    part, whole = fork(walk, "new", *new), fork(walk, "new-whole", *new, "--from-start")
    assert_ends_alike(read_recording(part), read_recording(whole))
    assert summary_of(part)["forked_from"] == summary_of(whole)["forked_from"]
    capsys.readouterr()
    main(["compare", str(part), str(whole)])
    assert "identical to the last bit: 265 states" in capsys.readouterr().out


def test_a_fork_of_a_fork_goes_on_from_its_keyframe(walk: Path) -> None:
    first = fork(walk, "first")
    second = fork(first, "second", at="0.1")  # s since the fork's own first state
    assert read_recordings(second)[0].keyframe is not None
    assert_ends_alike(read_recording(second), read_recording(walk))


@pytest.mark.nightly
def test_over_topics_it_is_the_same_fork(walk: Path) -> None:
    sent = fork(walk, "sent", "--through-topics")
    assert_ends_alike(read_recording(sent), read_recording(walk))
    for place in ("controller", "simulator"):
        assert main(["replay", str(sent), "--through-topics", place]) == 0


def test_no_keyframe_while_a_push_acts(make: Callable[..., Path]) -> None:
    run = make("pushed", *WALK, "--push", "chest:0,50,0@0.45")  # until 0.55 s
    assert not [m for m in read_messages(run / BAG) if m.topic == "/sim_node/keyframe"]
    assert len(read_recording(fork(run, "pushed-fork")).stamps_ns) == round(0.8 * 240) + 1


def test_without_keyframes_there_are_none(make: Callable[..., Path]) -> None:
    run = make("none", "--character", "pendulum", "--set", "sim_node.keyframe_period:=0")
    assert not [m for m in read_messages(run / BAG) if m.topic.endswith("keyframe")]
    assert read_recording(fork(run, "none-fork")).keyframe is None


def test_a_keyframe_of_other_versions_is_not_used(
    walk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorded = read_recording(walk).versions
    name = "actuated_characters.fork.plan.installed_versions"
    monkeypatch.setattr(name, lambda: {**recorded, "numpy": "0.1"})
    assert plan_fork(walk, 0.7, ForkInputs({})).skipped == 0
    monkeypatch.setattr(name, lambda: recorded)
    assert plan_fork(walk, 0.7, ForkInputs({})).skipped == 120


def test_a_fork_reads_from_its_keyframe_on(walk: Path) -> None:
    keyframes = find_keyframes(walk / BAG)
    assert keyframes is not None
    assert keyframes.before(0.49) is None
    begin = keyframes.before(0.5)
    assert begin is not None
    (recording,), (whole,) = read_recordings(walk, begin), read_recordings(walk)
    assert_ends_alike(recording, whole)
    assert recording.parameters == whole.parameters
    assert recording.controller == whole.controller


def resealed(keyframe: Keyframe, change: Callable[[bytes], bytes]) -> bytes:
    """A keyframe's message with something else in its memory, as this user's own."""
    packed = zlib.compress(change(zlib.decompress(keyframe.memory[32:])))
    return encode_keyframe(keyframe._replace(memory=memory._seal_of(packed) + packed))


@pytest.mark.parametrize("which", ["sim_node", "controller_node"])
def test_a_keyframe_of_another_version_is_an_error_of_one_line(
    walk: Path, which: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "other"
    with_changed(
        walk,
        run,
        f"/{which}/keyframe",
        lambda raw: resealed(decode_keyframe(raw), lambda content: content[:-40]),
    )
    capsys.readouterr()
    assert main(["fork", str(run), "--at", "0.7"]) == 1
    (line,) = [x for x in capsys.readouterr().err.splitlines() if x.startswith("error")]
    assert "a keyframe cannot be read" in line
    assert main(["fork", str(run), "--at", "0.7", "--from-start"]) == 0


def test_keyframes_of_another_user_are_not_opened(
    walk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(memory, "_key", lambda: bytes(32))
    assert plan_fork(walk, 0.7, ForkInputs({})).skipped == 0


def test_what_a_keyframe_has_is_compared(
    walk: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A state in it that is not the recorded one ends the fork."""
    moved = np.float64(read_recording(walk).position[120, 0])

    def change(content: bytes) -> bytes:
        assert moved.tobytes() in content
        return content.replace(moved.tobytes(), np.nextafter(moved, 1.0).tobytes())

    run = tmp_path / "changed"
    with_changed(
        walk, run, "/sim_node/keyframe", lambda raw: resealed(decode_keyframe(raw), change)
    )
    capsys.readouterr()
    assert main(["fork", str(run), "--at", "0.7"]) == 1
    assert "position of 'root_x'" in capsys.readouterr().err


def test_a_keyframe_may_come_behind_its_state(walk: Path, tmp_path: Path) -> None:
    """As in a bag of another recorder, whose topics are in no order."""
    messages = list(read_messages(walk / BAG))
    late = [each for each in messages if each.topic == "/sim_node/keyframe"]
    others = [each for each in messages if each not in late]
    after = [
        number
        for number, each in enumerate(others)
        if each.topic == "/joint_states" and decode_header(each.raw)[0] > 504_166_666
    ]
    others[after[0] : after[0]] = late
    write_in_order(tmp_path / "run" / BAG, others)
    keyframes = find_keyframes(tmp_path / "run" / BAG)
    assert keyframes is not None
    (recording,) = read_recordings(tmp_path / "run", keyframes.before(0.7))
    assert_ends_alike(recording, read_recording(walk))
    assert len(recording.stamps_ns) == round(0.3 * 240) + 1


def test_a_bag_of_the_last_part_begins_with_a_keyframe_that_came_behind_its_state(
    walk: Path, tmp_path: Path
) -> None:
    messages = list(read_messages(walk / BAG))
    latched = {"/sim_node/configuration", "/controller_node/configuration"}
    states = [n for n, each in enumerate(messages) if each.topic == "/joint_states"]
    kept = [each for n, each in enumerate(messages) if n >= states[60] or each.topic in latched]
    kept.sort(key=lambda each: each.topic == "/sim_node/keyframe")  # behind all else

    write_in_order(tmp_path / "run" / BAG, kept)
    recording = read_recording(tmp_path / "run")

    assert recording.keyframe is not None
    assert not recording.begins_amid
    assert recording.skipped_states == 60  # 0.5 s are 120 ticks
    assert_ends_alike(recording, read_recording(walk))
    assert replay(read_recordings(tmp_path / "run")).state_hashes


def write_in_order(bag: Path, messages: list[RecordedMessage]) -> None:
    """Write messages into a bag one after another."""
    bag.parent.mkdir()
    with BagWriter(bag) as writer:
        for topic, type_name in {each.topic: each.type_name for each in messages}.items():
            writer.add_topic(topic, type_name, Quality(1))
        for number, each in enumerate(messages, start=1):
            writer.write(each.topic, each.raw, number * 10**6)
