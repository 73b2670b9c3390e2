"""`shrink`: of runs by the command line that fall; what is left is tried by other runs of `run`."""

import re
import signal
from collections.abc import Sequence
from pathlib import Path

import pytest

from actuated_characters.bags.recording import read_recording
from actuated_characters.cli import main
from actuated_characters.commands.common import interruption
from actuated_characters.replay.replay import replay
from actuated_characters.runs.until_fall import Ended, Keyframe
from actuated_characters.shrink import trials as trials_module
from actuated_characters.shrink.inputs import Event, Setting
from actuated_characters.shrink.minimal import SHARE
from actuated_characters.shrink.shrinking import Shrinking, plan_shrinking
from actuated_characters.shrink.trial import TrialSetting, run_trial
from actuated_characters.shrink.trials import Trials
from msgs_config.errors import ReplayError
from msgs_config.messages.keyframe import decode_keyframe
from sim_node.interface.keyframes import read_memory
from sim_node.physics.simulation import Simulation
from sim_node.simulation_factory import make_character_setup, make_simulation_settings
from tests.support.runs import summary_of

pytestmark = [pytest.mark.slow, pytest.mark.sharing]

MACHINE = ("--machine", "walk", "--duration")
HARMLESS = (
    *("--cmd-vel", "0.4,0,0@0.1 0.2,0,0.3@0.4"),
    *("--push", "neck:20,0,0@0.2"),
    *("--throw", "mass=0.3 speed=5 at=0.5 target=chest"),
)
PARAMETER = "strength.neck"


def run(directory: Path, duration: float, *options: str) -> Path:
    given = ("run", "--in-process", *MACHINE, str(duration), *options)
    assert main([*given, "--output", str(directory)]) == 0
    return directory


def falls(directory: Path) -> bool:
    return bool(summary_of(directory)["fell"])


@pytest.fixture(scope="module")
def fallen(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fall by one push of six inputs, one of which is a changed parameter."""
    folder = tmp_path_factory.mktemp("fallen")
    pushed = run(folder / "pushed", 1.2, *HARMLESS, "--push", "chest:0,500,0@0.6")
    changed = ("--at", "0.3", "--from-start", "--set", f"controller_node.{PARAMETER}:=0.5")
    assert (
        main(["fork", str(pushed), *changed, "--duration", "1.6", "--output", f"{pushed}-f"]) == 0
    )
    return folder / "pushed-f"


@pytest.fixture(scope="module")
def plan(fallen: Path) -> Shrinking:
    return plan_shrinking(fallen)


def test_the_inputs_are_those_that_were_sent(plan: Shrinking) -> None:
    lines = plan.describe(dict.fromkeys(plan.order, 1.0))

    assert plan.total == 6
    assert lines[0] == '--cmd-vel "0.4,0,0@0.1 0.2,0,0.3@0.4"'
    assert re.match(r"a ball .* of 0.3 kg, let go at 0.1", lines[1])  # 2 m at 5 m/s, to 0.5 s
    assert lines[2] == "--push neck:20,0,0@0.2"
    assert lines[3].startswith(f"controller_node.{PARAMETER}:=0.5 from 0.3 s on (before: 1.0)")
    assert lines[4:] == ["--push chest:0,500,0@0.6"]


def test_what_is_left_falls_and_less_of_it_does_not(
    fallen: Path, plan: Shrinking, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shrunk = tmp_path / "shrunk"
    assert main(["shrink", str(fallen), "--output", str(shrunk)]) == 0

    said = capsys.readouterr().out
    found = re.search(r"1 of 6 inputs are left:\n  --push chest:0,([\d.]+),0@0.6\n", said)
    assert found and f"the run: {shrunk / 'bag'}" in said
    assert falls(shrunk) and falls(fallen)
    result = replay([read_recording(shrunk)])
    assert result.identical and result.state_hashes[""] == summary_of(shrunk)["state_hash"]
    force, duration = float(found[1]), float(summary_of(shrunk)["sim_time_s"])  # type: ignore[arg-type]
    assert force < 500.0
    same = run(tmp_path / "same", duration, "--push", f"chest:0,{found[1]},0@0.6")
    assert summary_of(same)["state_hash"] == summary_of(shrunk)["state_hash"]
    less = f"{(1.0 - SHARE) * force:.12g}"  # near the least force each digit counts
    weaker = run(tmp_path / "less", duration, "--push", f"chest:0,{less},0@0.6")
    assert not falls(weaker)
    assert duration == pytest.approx(float(summary_of(fallen)["fell_at_s"]) + 1.3, abs=0.01)  # type: ignore[arg-type]


@pytest.mark.nightly
def test_one_process_leaves_what_several_do(
    fallen: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = []
    for workers in ("1", "3"):
        output = tmp_path / workers
        given = ("shrink", str(fallen), "--output", str(output), "--workers", workers)
        assert main(given) == 0
        said.append(capsys.readouterr().out.replace(str(output), ""))

    assert said[0] == said[1]
    assert summary_of(tmp_path / "1")["state_hash"] == summary_of(tmp_path / "3")["state_hash"]


def state_in(keyframe: Keyframe, setting: TrialSetting) -> tuple[int, bytes, bytes]:
    """Stamp, position and velocity in a simulator's keyframe."""
    setup = make_character_setup(setting.plan.character, setting.plan.simulator)
    with Simulation([setup], make_simulation_settings(setting.plan.simulator)) as simulation:
        snapshot, _ = read_memory(decode_keyframe(keyframe.simulator).memory, simulation)
        (character,) = snapshot.characters
        state = character.state
        return state.stamp_ns, state.position.tobytes(), state.velocity.tobytes()


def test_a_trial_from_a_keyframe_is_the_whole_one_to_the_bit(
    plan: Shrinking, tmp_path: Path
) -> None:
    setting = Trials(plan, tmp_path).setting
    events = plan.events(dict.fromkeys(plan.order, 0.3))
    assert any(isinstance(event.content, Setting) for event in events)

    whole = run_trial(setting, events, None)
    rows = [setting.row_of(each) for each in whole.keyframes]
    assert rows[:2] == [120, 180]  # a quarter of a second apart; none while a push acts
    again = run_trial(setting, events, whole.keyframes[1])

    assert again.fell == whole.fell
    last, same = whole.keyframes[-1], again.keyframes[-1]
    assert last.tick == same.tick > 240
    assert state_in(last, setting) == state_in(same, setting)


def test_trials_from_the_start_of_a_fork_begin_with_its_keyframe(tmp_path: Path) -> None:
    period = ("--set", "sim_node.keyframe_period:=0.25")
    pushed = run(tmp_path / "pushed", 1.0, *period)
    fork = ("--at", "0.6", "--push", "chest:0,900,0@0.7", "--duration", "1.6")
    assert main(["fork", str(pushed), *fork, "--output", str(tmp_path / "fork")]) == 0
    plan = plan_shrinking(tmp_path / "fork")
    assert plan.fork.recording.keyframe is not None
    setting, events = Trials(plan, tmp_path).setting, plan.events({0: 1.0})

    first = run_trial(setting, events, None)
    run_trial(setting, events, first.keyframes[-1])
    again = run_trial(setting, events, None)

    assert [each.tick for each in first.keyframes] == [each.tick for each in again.keyframes]
    assert state_in(first.keyframes[0], setting) == state_in(again.keyframes[0], setting)


def test_a_recording_that_is_not_repeated_leaves_nothing(
    fallen: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def other(*given: object, **named: object) -> Ended:
        raise ReplayError("tick 3 differs")

    monkeypatch.setattr(trials_module, "run_trial", other)
    assert main(["shrink", str(fallen), "--output", str(tmp_path / "out")]) == 1

    assert capsys.readouterr().err.endswith("error: tick 3 differs\n")
    assert not (tmp_path / "out").exists()


def test_an_interruption_keeps_the_best_so_far(
    fallen: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    trials: list[Sequence[Event]] = []

    def interrupted(
        setting: object, events: Sequence[Event], *given: object, **named: object
    ) -> Ended:
        trials.append(events)
        if len(trials) == 2:
            signal.raise_signal(signal.SIGINT)
        return run_trial(setting, events, *given, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(trials_module, "run_trial", interrupted)
    monkeypatch.setattr(interruption, "_is_interrupted", False)  # as it is again afterwards
    assert (
        main(["shrink", str(fallen), "--output", str(tmp_path / "best"), "--workers", "1"]) == 130
    )

    said = capsys.readouterr()
    assert "interrupted; the best so far" in said.err
    assert "6 of 6 inputs are left:" in said.out
    assert '  --cmd-vel "0.4,0,0@0.1 0.2,0,0.3@0.4"\n' in said.out
    assert falls(tmp_path / "best")


def test_a_run_that_did_not_fall_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stood = run(tmp_path / "stood", 0.1)
    capsys.readouterr()

    assert main(["shrink", str(stood)]) == 1

    assert capsys.readouterr().err == (
        f"error: {stood} did not fall, so that there is nothing to shrink\n"
    )
    assert not (tmp_path / "stood-shrunk").exists()


def test_the_run_itself_is_not_overwritten(
    fallen: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["shrink", str(fallen), "--output", str(fallen), "--overwrite"]) == 1

    assert f"--output {fallen} is the run that is to be shrunk" in capsys.readouterr().err
    assert falls(fallen)
