"""A reconstruction played over topics: real nodes, the same doubles."""

import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from experiment.cli import main
from experiment.planned_push import pushes_within
from experiment.samcon.problem import Problem
from experiment.samcon.reconstruction import Job, reconstruct
from experiment.samcon.settings import preset
from msgs_config.character_loading import load_character

pytestmark = [pytest.mark.slow, pytest.mark.sharing]

DURATION = 0.3  # s
PUSHES = ("chest:150,0,0@0.1", "root:0,100,0@0.25")


def job(file: Path, simulator: dict[str, object], pushes: tuple[str, ...] = ()) -> Job:
    """A short search, with a feedback and gains of its own."""
    settings = preset("humanoid", "kick", samples=8, kept=2, lookahead=0)
    assert any(settings.feedback.values())
    assert settings.gains
    problem = Problem.of("humanoid", "kick", DURATION, settings, simulator, pushes)
    return Job(problem, 1, settings, file)


@pytest.mark.parametrize(("rate", "delay", "pushes"), [(240, 0, ()), (480, 1, PUSHES)])
def test_over_topics_it_is_what_was_found_bit_for_bit(
    domain: int, tmp_path: Path, rate: int, delay: int, pushes: tuple[str, ...]
) -> None:
    del domain
    file, directory = tmp_path / "kick.json", tmp_path / "run"
    found = reconstruct(job(file, {"rate": rate, "command_delay_ticks": delay}, pushes))

    code = main(["run", "--clip", str(file), "--output", str(directory)])

    summary = json.loads((directory / "summary.json").read_text())
    assert code == 0
    assert summary["ticks"] == round(DURATION * rate) == found.figures.ticks
    assert summary["actuators"] == summary["degrees_of_freedom"] - 6
    assert summary["state_hash"] == found.figures.state_hash
    assert main(["replay", str(directory)]) == 0


def test_what_a_file_was_found_with_goes_behind_what_is_set(tmp_path: Path) -> None:
    file, directory = tmp_path / "kick.json", tmp_path / "run"
    reconstruct(job(file, {"rate": 480, "command_delay_ticks": 1}))
    given = ["--set", "controller_node.rate:=240", "--set", "controller_node.gains.left_knee.d:=9"]

    code = main(
        [
            *("run", "--clip", str(file), "--duration", "0.1", "--in-process", *given),
            *("--output", str(directory)),
        ]
    )

    parameters = {
        name: yaml.safe_load((directory / "parameters" / f"{name}.yaml").read_text())
        for name in ("sim_node", "controller_node")
    }
    simulator, controller = (next(iter(content.values())) for content in parameters.values())
    simulator, controller = simulator["ros__parameters"], controller["ros__parameters"]
    assert code == 0
    assert (simulator["rate"], simulator["command_delay_ticks"]) == (240, 1)
    assert simulator["max_ticks"] == 24
    assert controller["gains.left_knee.d"] == 9.0
    assert controller["gains.right_knee.d"] == 25.0
    assert controller["root_assistance"] is False


@pytest.fixture(scope="module")
def kick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A reconstruction's file."""
    file = tmp_path_factory.mktemp("kick") / "kick.json"
    reconstruct(job(file, {}))
    return file


def changed(kick: Path, tmp_path: Path, **made: object) -> Path:
    """The file, with other things said of how it was found."""
    content = json.loads(kick.read_text())
    content["Reconstruction"].update(made)
    file = tmp_path / "kick.json"
    file.write_text(json.dumps(content))
    return file


def simulated(file: Path, directory: Path, *options: str) -> dict[str, object]:
    """The simulator's parameters of a file's run in one process."""
    run = ("run", "--clip", str(file), "--in-process", "--output", str(directory))
    assert main([*run, *options]) == 0
    (written,) = yaml.safe_load((directory / "parameters" / "sim_node.yaml").read_text()).values()
    parameters: dict[str, object] = written["ros__parameters"]
    return parameters


def test_an_unfinished_one_is_run_as_far_as_it_was_found(kick: Path, tmp_path: Path) -> None:
    file = changed(kick, tmp_path, duration=100.0, complete=False)

    assert simulated(file, tmp_path / "run")["max_ticks"] == round(DURATION * 240)


def hash_of(file: Path, directory: Path, *options: str) -> str:
    """The hash of the states of a file's run in one process."""
    simulated(file, directory, *options)
    return str(json.loads((directory / "summary.json").read_text())["state_hash"])


def test_pushes_that_were_known_come_again_unless_others_are_given(tmp_path: Path) -> None:
    file, unpushed = tmp_path / "pushed.json", tmp_path / "unpushed.json"
    found = reconstruct(job(file, {}, PUSHES))
    unpushed.write_text(json.dumps(without_pushes(file)))
    one = ("--push", PUSHES[0])

    known = hash_of(file, tmp_path / "known")
    none = hash_of(file, tmp_path / "none", "--push", "none")
    other = hash_of(file, tmp_path / "other", *one)
    short = hash_of(file, tmp_path / "short", "--duration", "0.2")

    assert known == found.figures.state_hash
    assert none == hash_of(unpushed, tmp_path / "1") != known
    assert other == hash_of(unpushed, tmp_path / "2", *one) not in (known, none)
    assert short == hash_of(unpushed, tmp_path / "3", *one, "--duration", "0.2")


def test_pushes_that_would_begin_at_the_end_or_later_are_left_out() -> None:
    plan = Problem("humanoid", "kick", 0.2, 0.1).plan()

    assert not pushes_within(["root:1,0,0@0.199", "root:1,0,0@0.2", "root:1,0,0@9"], plan)
    assert len(pushes_within(["root:1,0,0@0.197"], plan)) == 1


def test_no_push_goes_with_no_other(kick: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pushes = ("--push", "none", "--push", PUSHES[0])

    assert main(["run", "--clip", str(kick), *pushes, "--in-process"]) != 0
    assert "--push none goes with no other" in capsys.readouterr().err


def without_pushes(file: Path) -> dict[str, Any]:
    """The content of a file that says nothing of its pushes, as older ones did not."""
    content: dict[str, Any] = json.loads(file.read_text())
    del content["Reconstruction"]["pushes"]
    return content


def test_joints_that_are_commanded_decide_on_the_roots_assistance(
    kick: Path, tmp_path: Path
) -> None:
    joints = load_character("humanoid").layout.joint_names
    given = f"sim_node.commanded_joints:=[{', '.join(joints)}]"

    found = simulated(kick, tmp_path / "run", "--set", given)

    assert found["commanded_joints"] == list(joints)


@pytest.mark.parametrize(
    ("made", "reason"),
    [
        ({"duration": "long"}, "Reconstruction must have 'duration', 'complete', '"),
        ({"duration": 10**400}, "Reconstruction must have 'duration'"),
        ({"parameters": {"sim_node": {}}}, "Reconstruction must have 'duration'"),
        ({"duration": 0.0}, "duration is 0.0 s"),
        ({"pushes": 7}, "and 'pushes' as texts"),
        ({"pushes": "root:1,0,0@0.1"}, "and 'pushes' as texts"),
        ({"pushes": ["tail:1,0,0@0.1"]}, "unknown link 'tail'"),
        ({"pushes": ["root"]}, "write it as LINK:FX,FY,FZ@S"),
    ],
)
def test_a_file_that_does_not_say_how_it_was_found_is_refused(
    kick: Path,
    tmp_path: Path,
    made: dict[str, object],
    reason: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    file = changed(kick, tmp_path, **made)

    code = main(["run", "--clip", str(file), "--output", str(tmp_path / "run")])

    assert code == 1
    assert reason in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
