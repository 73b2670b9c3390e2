"""The command `train`: from options to a file that `run` plays."""

import json
import shlex
import signal
from collections.abc import Sequence
from pathlib import Path
from shutil import copy

import numpy as np
import pytest

from actuated_characters.cli import main
from actuated_characters.commands.common.interruption import Interrupted
from actuated_characters.commands.train import command, outcome, preparing
from actuated_characters.training import acceptance, exercises
from actuated_characters.training.acceptance import Trial
from actuated_characters.training.exercises import Exercise
from actuated_characters.training.training import Progress, Training
from controller_node.planner.policy.file import read_policy
from msgs_config.clips.reading import clip_path
from tests.support.physics import DATA
from tests.support.policies import write_random_policy
from tests.support.training import HUMANOID, make_small

FEW = ["--minutes", "0.01"]  # 64 decisions, see `small`
OWN_CLIP = str(DATA / "walk_reconstructed.json")


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Minutes of few decisions, tried for a moment, where files may be left."""
    monkeypatch.chdir(tmp_path)
    make_small(monkeypatch)
    for module in (command, preparing):
        monkeypatch.setattr(module, "DECISIONS_A_MINUTE", 6_400)
    monkeypatch.setattr(exercises, "_TRIED_S", 0.4)
    monkeypatch.setattr(exercises, "_DRIVEN_S", 1.0)
    monkeypatch.setattr(outcome, "_TRIALS", 2)


@pytest.mark.nightly
@pytest.mark.slow
def test_what_it_makes_is_played(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    given = ["--set", "controller_node.rate:=120", "--seed", "3"]

    assert main(["train", *FEW, *given]) == 0

    said = capsys.readouterr().out
    (line,) = [line for line in said.splitlines() if line.startswith("play it:")]
    assert "controller_node.rate:=120" in line
    policy = read_policy("policies/humanoid-walk.npz", HUMANOID)
    assert policy.rate_hz == 120
    assert "64 decisions" in said
    assert {figures["to the end"] for figures in policy.about["figures"].values()} == {"2 of 2"}
    assert "walk, mujoco" in policy.about["figures"]
    assert "walk, mujoco" in said
    words = line.removeprefix("play it: actuated_characters ").split()
    assert main([*words, "--in-process", "--duration", "0.3", "--output", "run"]) == 0
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert not summary["fell"]
    shown = Path("policies/humanoid-walk-played")
    for name in ("bag", "summary.json", "strip.png", "video.mp4"):
        assert (shown / name).exists()
        assert name in ("bag", "summary.json") or str(shown / name) in said


@pytest.mark.nightly
def test_another_runs_results_are_replaced_where_files_may_be(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(acceptance, "attempt", no_trials)
    given = ["train", *FEW, "--output", "walk.npz"]
    plot = tmp_path / "walk-played" / "plot.png"
    plot.parent.mkdir()
    plot.write_text("another's")

    assert main(given) == 0
    assert "holds results already" in capsys.readouterr().err
    assert plot.read_text() == "another's"
    assert main([*given, "--overwrite"]) == 0
    assert "no run to look at" not in capsys.readouterr().err
    assert plot.read_bytes().startswith(b"\x89PNG")


def test_files_where_its_run_would_go_are_left_alone(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(acceptance, "attempt", no_trials)
    (tmp_path / "walk-played").mkdir()
    (tmp_path / "walk-played" / "mine.txt").write_text("mine")

    assert main(["train", *FEW, "--output", "walk.npz"]) == 0

    said = capsys.readouterr()
    assert "no run to look at: " in said.err and "holds other files" in said.err
    assert "play it:" in said.out
    assert [path.name for path in (tmp_path / "walk-played").iterdir()] == ["mine.txt"]
    read_policy("walk.npz", HUMANOID)


@pytest.mark.nightly
@pytest.mark.slow
def test_what_learned_to_be_steered_is_steered(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main(["train", *FEW, "--steer"]) == 0

    said = capsys.readouterr().out
    (line,) = [line for line in said.splitlines() if line.startswith("play it:")]
    words = shlex.split(line.removeprefix("play it: actuated_characters "))
    policy = read_policy("policies/humanoid-steered.npz", HUMANOID)
    assert policy.about["clips"] == ["steered"]
    assert main([*words, "--in-process", "--duration", "0.4", "--output", "run"]) == 0
    assert not json.loads((tmp_path / "run" / "summary.json").read_text())["fell"]
    assert main(["run", "--clip", "walk", *words[words.index("--planner") :]]) == 1
    assert "was trained on steered; the clip is walk" in capsys.readouterr().err


def test_it_says_how_to_play_another_character(capsys: pytest.CaptureFixture[str]) -> None:
    parser_given = ["--character", "my robot.urdf", "--set", "controller_node.rate:=120"]
    options = _options(["train", *parser_given])

    outcome.say_how_to_play(options, Exercise("my robot.urdf", "my clip.csv"), Path("a b.npz"))

    assert capsys.readouterr().out.split("play it: ")[1].strip() == (
        "actuated_characters run --clip 'my clip.csv' --planner policy --character "
        "'my robot.urdf' --set 'controller_node.policy:=a b.npz' --set controller_node.rate:=120"
    )


def _options(arguments: Sequence[str]) -> object:
    from actuated_characters.cli import _parser

    return _parser().parse_args(arguments)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--minutes", "0"], "--minutes is 0; it must be 0.01 or more"),
        (["--minutes", "nan"], "--minutes is nan; it must be 0.01 or more"),
        (["--minutes", "inf"], "--minutes is inf"),
        (["--pushes", "-1"], "--pushes is -1; it must be 0 or more"),
        (["--pushes", "inf"], "--pushes is inf"),
        (["--seed", "-1"], "--seed is -1; it must be 0 or more"),
        (["--hidden", "0"], "--hidden is 0; it must be 2 or more"),
        (["--threads", "0"], "--threads is 0; it must be 1 or more"),
        (["--clip", "wlak"], "wlak"),
        (["--after", "wlak"], "wlak"),
        (["--after", "fall"], "walk begins standing"),
        (["--clip", "folder.npz"], "there is no .json or .txt file of motion in it"),
        (["--clip", "steered.json"], "--clip steered.json: a policy keeps that name for --steer"),
        (["--character", "humanoit"], "humanoit"),
        (["--character", "pendulum"], "pendulum"),
        (["--character", str(DATA / "free_box.yaml")], "free_box"),
        (["--output", "walk.zip"], "--output is walk.zip; it must end in .npz"),
        (["--output", "nowhere/walk.npz"], "there is no directory nowhere"),
        (["--output", "folder.npz"], "--output is folder.npz; it is a directory"),
        (["--output", "there.npz"], "there.npz exists; --resume goes on, --overwrite starts over"),
        (["--output", "there.npz", "--resume", "--clip", "run"], "clips: walk"),
        (["--output", "broken.npz", "--resume"], "broken.npz"),
        (["--from", "broken.npz"], "broken.npz"),
        (["--from", "wlak"], "wlak"),
        (["--imitate", "wlak"], "wlak"),
        (["--imitate", "run"], "was trained on run, none of which is trained here: walk"),
        (["--imitate", "--clip", OWN_CLIP], f"--imitate: no policy of {OWN_CLIP} is shipped; name"),
        (["--imitate", "--set", "controller_node.rate:=120"], "the policy of walk's rate: 240"),
        (["--from", "walk", "--character", "laikago"], "does not fit 'laikago'"),
        (["--set", "controller_node.planner:=none"], "controller_node.planner:=none"),
        (["--set", "controller_node.policy:=x.npz"], "controller_node.policy:=x.npz"),
        (["--set", "controller_node.reference:=hold"], "reference"),
        (["--set", "controller_node.behaviour:=reactive"], "has the behaviour tracking"),
        (["--set", "controller_node.plan.friction:=0.5"], "it takes plan.weight., plan.gives_way"),
        (["--set", "controller_node.law:=pd"], "stable_pd"),
        (["--set", "controller_node.wieght:=1"], "wieght"),
        (["--set", "sim_node.rate:=120"], "sim_node"),
    ],
)
def test_a_mistake_is_one_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, options: list[str], says: str
) -> None:
    (tmp_path / "folder.npz").mkdir()
    write_random_policy(tmp_path / "there.npz", HUMANOID)
    (tmp_path / "broken.npz").write_text("no archive")
    (tmp_path / "steered.json").write_text("{}")
    before = (tmp_path / "there.npz").read_bytes()

    assert main(["train", *FEW, *options]) == 1

    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ")
    assert says in line
    assert (tmp_path / "there.npz").read_bytes() == before
    assert not (tmp_path / "policies").exists()


def no_trials(*ignored: object) -> Trial:
    return Trial(0.4, True, 0.01, 0.02)


@pytest.mark.nightly
def test_it_overwrites_and_goes_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    make_small(monkeypatch, _LOOKS=1)
    monkeypatch.setattr(acceptance, "attempt", no_trials)
    given = ["train", "--output", "walk.npz", "--threads", "1"]

    assert main([*given, "--minutes", "0.01", "--resume"]) == 0
    assert "there is no walk.npz: the training begins" in capsys.readouterr().err
    write_random_policy(tmp_path / "walk.npz", HUMANOID)

    assert main([*given, "--minutes", "0.01", "--overwrite"]) == 0
    assert read_policy("walk.npz", HUMANOID).about["trained"]["decisions"] == 64
    assert main([*given, "--minutes", "0.01", "--resume"]) == 1
    assert "64 decisions" in capsys.readouterr().err
    assert main([*given, "--minutes", "0.02", "--resume"]) == 0
    assert "128 decisions" in capsys.readouterr().out


def interrupted_at(
    monkeypatch: pytest.MonkeyPatch, count: int, number: int = signal.SIGINT
) -> None:
    """Have a signal come in the midst of a trace."""
    go_on, calls = Training.go_on, []

    def interrupted(self: Training) -> Progress:
        calls.append(None)
        progress = go_on(self)
        if len(calls) == count:
            self._learner.averages[0].bias_3[:] = np.nan  # whatever is half done
            raise Interrupted(number)
        return progress

    monkeypatch.setattr(Training, "go_on", interrupted)


@pytest.mark.slow
def test_an_interruption_keeps_the_best(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    make_small(monkeypatch, _LOOKS=10_000)  # one after each trace
    interrupted_at(monkeypatch, 3)
    monkeypatch.setattr(acceptance, "attempt", no_trials)

    assert main(["train", "--minutes", "10", "--output", "walk.npz"]) == 0

    policy = read_policy("walk.npz", HUMANOID)
    assert np.isfinite(policy.network.bias_3).all()
    assert policy.about["figures"]["walk, mujoco"]["to the end"] == "2 of 2"
    said = capsys.readouterr()
    assert "interrupted; the best so far is in walk.npz" in said.err
    assert "play it:" in said.out


def test_it_says_each_look_also_where_it_keeps_nothing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    make_small(monkeypatch, _LOOKS=10_000)
    interrupted_at(monkeypatch, 4, signal.SIGTERM)
    scores = iter((0.2, 0.1, 0.5))
    monkeypatch.setattr(Training, "_score", lambda *ignored: next(scores))

    with pytest.raises(Interrupted):
        main(["train", "--pushes", "0", "--output", "walk.npz"])

    looks = [line for line in capsys.readouterr().err.splitlines() if " falls in " in line]
    assert [line.rsplit(": ", 1)[1] for line in looks] == ["best so far", "not kept", "best so far"]


def test_who_ends_it_for_good_has_the_best_without_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    make_small(monkeypatch, _LOOKS=10_000)
    interrupted_at(monkeypatch, 3, signal.SIGTERM)

    with pytest.raises(Interrupted):  # the command itself says so
        main(["train", "--minutes", "10", "--output", "walk.npz"])

    policy = read_policy("walk.npz", HUMANOID)
    assert np.isfinite(policy.network.bias_3).all()
    assert policy.about["figures"] == {}


def test_a_file_of_many_clips_is_named_by_the_first_ones() -> None:
    clips = ("walk", "run", "a/jump.csv", "roll", "kick")

    output = preparing.output_file(_options(["train"]), clips)

    assert output == Path("policies/humanoid-walk-run-jump-and-2-more.npz")


@pytest.mark.nightly
def test_a_folders_clips_are_learned_by_one_policy(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(acceptance, "attempt", no_trials)
    (tmp_path / "clips").mkdir()
    for name in ("walk", "kick"):
        copy(clip_path(HUMANOID, name), tmp_path / "clips" / f"{name}.txt")

    assert main(["train", *FEW, "--clip", "clips"]) == 0

    policy = read_policy("policies/humanoid-clips.npz", HUMANOID)
    assert policy.about["clips"] == ["clips/kick.txt", "clips/walk.txt"]
    assert {name.rsplit(", ", 1)[0] for name in policy.about["figures"]} == {*policy.about["clips"]}


@pytest.mark.slow
@pytest.mark.parametrize("over", [0, 1])
def test_a_second_interruption_leaves_out_the_runs_that_are_not_over(
    over: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    make_small(monkeypatch, _LOOKS=10_000)
    interrupted_at(monkeypatch, 1)
    left = [no_trials()] * over

    def interrupted(*ignored: object) -> Trial:
        if left:
            return left.pop()
        raise Interrupted

    monkeypatch.setattr(acceptance, "attempt", interrupted)

    assert main(["train", "--minutes", "10", "--output", "walk.npz"]) == 0

    figures = read_policy("walk.npz", HUMANOID).about["figures"]
    assert [each["to the end"] for each in figures.values()] == ["1 of 1"] * over
    said = capsys.readouterr()
    assert "play it:" in said.out
    assert "Traceback" not in said.err
    kept = ["walk-played", "walk.npz"] if over else ["walk.npz"]
    assert sorted(path.name for path in tmp_path.iterdir()) == kept


def test_an_interruption_before_anything_is_worth_keeping_leaves_the_file(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    interrupted_at(monkeypatch, 1)
    write_random_policy(tmp_path / "walk.npz", HUMANOID)
    before = (tmp_path / "walk.npz").read_bytes()

    with pytest.raises(Interrupted):  # the command itself says "interrupted"
        main(["train", "--minutes", "10", "--output", "walk.npz", "--overwrite"])

    assert (tmp_path / "walk.npz").read_bytes() == before
    assert "play it" not in capsys.readouterr().out


def test_the_help_says_what_is_trained(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["train", "--help"])

    said = " ".join(capsys.readouterr().out.split())
    for each in ("--clip NAME", "--minutes M", "6,400 decisions", "policies/CHARACTER-CLIP.npz"):
        assert each in said  # of `small`
    assert "--planner policy" in said
