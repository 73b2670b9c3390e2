"""Captured motion with joint torques alone: worlds that plan, and the search that chooses."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from multiprocessing import active_children
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
import yaml

from actuated_characters.cli import main
from actuated_characters.reconstruction.checkpoint import checkpoint_path
from actuated_characters.reconstruction.problem import Problem, duration_of
from actuated_characters.reconstruction.reconstruction import Job, Reconstruction, reconstruct
from actuated_characters.reconstruction.search import Progress, SearchSettings, result, search
from actuated_characters.reconstruction.workers import Workers
from actuated_characters.reconstruction.world import Branch, Grown, Lost, Place, TrialWorld
from actuated_characters.runs.planned.wrenches import parse_pushes_within
from msgs_config.errors import ActuatedCharactersError, ConfigurationError, RunError
from tests.support.ros import wait_until

pytestmark = [pytest.mark.slow, pytest.mark.sharing]

PROJECT = Path(__file__).parents[3]
QUICK = {"plan.samples": 8, "plan.rounds": 1, "plan.horizon": 0.2}
SMALL = SearchSettings(worlds=3, survivors=2, window=0.1)
DURATION = 0.3  # s
PROBLEM = Problem("humanoid", "kick", DURATION, {}, QUICK)
WINDOW = 24  # ticks
SET = ("--output", "walk.json", "--set")
PUSHES = ("chest:150,0,0@0.1", "root:0,100,0@0.25")


@pytest.fixture(scope="module")
def world() -> Iterator[TrialWorld]:
    world = TrialWorld(PROBLEM, WINDOW)
    yield world
    world.close()


def same(one: Grown | Lost, other: Grown | Lost) -> bool:
    """Whether two worlds ended in the same state, with the same plans, to the bit."""
    assert isinstance(one, Grown) and isinstance(other, Grown)
    return (
        one.end.tobytes() == other.end.tobytes()
        and [tick for tick, _ in one.plans] == [tick for tick, _ in other.plans]
        and all(
            a.rows.tobytes() == b.rows.tobytes()
            for (_, a), (_, b) in zip(one.plans, other.plans, strict=True)
        )
        and (one.cost, one.ahead) == (other.cost, other.ahead)
    )


# A world


def test_from_a_place_it_goes_on_as_if_it_had_never_left_it(world: TrialWorld) -> None:
    first = world.grow(Branch(None, (1,)))
    assert isinstance(first, Grown)
    at_once = world.grow(Branch(None, (1, 2)))
    world.grow(Branch(None, (5, 6)))

    later = world.grow(Branch(first.place, (2,)))

    assert same(later, at_once)
    assert not same(later, world.grow(Branch(first.place, (3,))))


def test_other_processes_get_the_same_numbers_wherever_they_begin(world: TrialWorld) -> None:
    first = world.grow(Branch(None, (1,)))
    assert isinstance(first, Grown)
    branches = [Branch(first.place, (seed,)) for seed in (1, 2)] + [Branch(None, (3,))]
    alone = [world.grow(branch) for branch in branches]

    with Workers(PROBLEM, WINDOW, 2) as workers:
        together = list(workers.grow(branches))

    assert all(same(one, other) for one, other in zip(alone, together, strict=True))


def test_what_a_process_did_that_was_killed_is_done_again(world: TrialWorld) -> None:
    branches = [Branch(None, (seed,)) for seed in range(6)]

    with Workers(PROBLEM, WINDOW, 2) as workers:
        growing = workers.grow(branches)
        found = [next(growing)]
        killed = active_children()[0]
        os.kill(killed.pid or 0, signal.SIGKILL)
        found += growing

    assert all(same(g, world.grow(b)) for g, b in zip(found, branches, strict=True))


@pytest.mark.parametrize(
    ("simulator", "controller"),
    [({"speed_limit": 0.5}, {}), ({}, {"gain_scale.p": 0.0, "gain_scale.d": 0.0})],
    ids=["it diverges", "it falls"],
)
def test_a_world_is_lost_in_which(
    simulator: dict[str, object], controller: dict[str, object]
) -> None:
    problem = Problem("humanoid", "kick", 1.5, simulator, {**QUICK, **controller})
    whole = TrialWorld(problem, 360)

    assert isinstance(whole.grow(Branch(None, (1,))), Lost)
    whole.close()


# The search


LOST = Lost(np.zeros((1, 1)))


class Numbered:
    """Worlds that are numbers: a window adds its seed's last digit; some are lost."""

    def __init__(self, deadly: int = 10**9) -> None:
        self.deadly = deadly  # tick from which all are lost the first time
        self.grown = 0

    def grow(self, branches: Sequence[Branch]) -> Iterator[Grown | Lost]:
        """The number so far stands in the end state."""
        for branch in branches:
            tick = 0 if branch.place is None else branch.place.tick
            place = Place(tick + len(branch.seeds), cast(Any, None), cast(Any, None))
            self.grown += 1
            failures = branch.seeds[-1] // 2**10 % 2**10
            fails = place.tick >= self.deadly and not failures
            cost = float(branch.seeds[-1] % 2**10)
            yield LOST if fails else Grown(place, (), LOST.motion, np.zeros(1), cost, 0.0)


def progress_of(
    worlds: Numbered, windows: int, settings: SearchSettings
) -> tuple[int | None, Progress]:
    """Where a search is stuck, and its end."""
    progress = Progress([])
    return search(worlds, windows, settings, progress, lambda _: None), progress


def test_the_best_worlds_are_kept_and_the_others_go_on_from_them() -> None:
    stuck_at, progress = progress_of(Numbered(), 5, SearchSettings(worlds=6, survivors=2))

    best = result(progress)
    assert stuck_at is None and best is not None
    assert [node.cost for node in best.path] == [0.0] * 5
    assert [[node.cost for node in level] for level in progress.levels] == [[0.0, 1.0]] * 5


def test_where_all_are_lost_it_goes_back_and_tries_others() -> None:
    worlds = Numbered(deadly=4)

    stuck_at, progress = progress_of(worlds, 6, SearchSettings(worlds=4, survivors=1))

    assert stuck_at is None and progress.failures == 1
    assert worlds.grown == 4 * (3 + 1 + 2 + 3)  # to the third, lost, back by two, to the sixth


def test_who_is_stuck_gives_up_and_has_the_furthest_window() -> None:
    class Deadly(Numbered):
        def grow(self, branches: Sequence[Branch]) -> Iterator[Grown | Lost]:
            for grown in super().grow(branches):
                yield LOST if isinstance(grown, Grown) and grown.place.tick > 3 else grown

    stuck_at, progress = progress_of(Deadly(), 6, SearchSettings(worlds=2, survivors=1, tries=3))

    best = result(progress)
    assert stuck_at == 3 and best is not None
    assert best.tick == 3
    assert (progress.stuck, progress.failures) == (0, 3)  # resumed, it tries with other numbers


# A reconstruction


def job(file: Path, **changes: object) -> Job:
    """A short search."""
    problem = replace(PROBLEM, **cast(Any, changes))
    return Job(problem, SMALL, file)


@pytest.fixture(scope="module")
def kick(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Reconstruction]:
    """A reconstruction and its file."""
    file = tmp_path_factory.mktemp("kick") / "kick.json"
    return file, reconstruct(job(file))


@pytest.mark.parametrize(
    ("rate", "delay", "pushes"),
    [(240, 0, ()), pytest.param(480, 1, PUSHES, marks=pytest.mark.nightly)],
)
def test_over_topics_it_is_what_was_found_bit_for_bit(
    domain: int, tmp_path: Path, rate: int, delay: int, pushes: tuple[str, ...]
) -> None:
    del domain
    file, directory = tmp_path / "kick.json", tmp_path / "run"
    simulator = {"rate": rate, "command_delay_ticks": delay}
    found = reconstruct(job(file, simulator=simulator, pushes=pushes))

    code = main(["run", "--clip", str(file), "--output", str(directory)])

    summary = json.loads((directory / "summary.json").read_text())
    assert code == 0
    assert summary["ticks"] == round(DURATION * rate) == found.metrics.ticks
    assert summary["actuators"] == summary["degrees_of_freedom"] - 6
    assert summary["state_hash"] == found.metrics.state_hash
    assert main(["replay", str(directory)]) == 0


@pytest.mark.nightly
def test_the_number_of_processes_and_an_interruption_change_nothing(
    kick: tuple[Path, Reconstruction], tmp_path: Path
) -> None:
    file = tmp_path / "kick.json"

    def interrupt(progress: Progress, windows: int) -> None:
        del windows
        if progress.window == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        reconstruct(replace(job(file), workers=2), interrupt)
    assert checkpoint_path(file).exists() and not file.exists()
    reconstruct(replace(job(file), workers=1, resume=True))

    assert file.read_text() == kick[0].read_text()
    assert not checkpoint_path(file).exists()


def test_another_search_is_not_resumed(tmp_path: Path) -> None:
    file = tmp_path / "kick.json"

    def interrupt(progress: Progress, windows: int) -> None:
        del windows
        if progress.window == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        reconstruct(job(file), interrupt)
    other = replace(job(file), settings=replace(SMALL, seed=2), resume=True)

    with pytest.raises(ConfigurationError, match="whose seed is 1, not 2"):
        reconstruct(other)


def test_what_cannot_be_borne_ends_with_the_best_attempt(tmp_path: Path) -> None:
    file = tmp_path / "kick.json"
    strong = job(file, pushes=("root:0,0,100000@0.15",))

    with pytest.raises(RunError, match="without getting any further, at last at window 2 of 3"):
        reconstruct(replace(strong, settings=replace(SMALL, tries=2)))

    made = json.loads(file.read_text())["Reconstruction"]
    assert made["duration"] == pytest.approx(0.1)
    assert simulated(file, tmp_path / "run")["max_ticks"] == WINDOW


def test_only_a_clip_that_wraps_has_cycles() -> None:
    assert duration_of("humanoid", "walk", 3) == pytest.approx(3 * 1.2667, abs=1e-3)
    with pytest.raises(ActuatedCharactersError, match="the clip 'kick' ends, it must be 1"):
        duration_of("humanoid", "kick", 2)


# Its run


def simulated(file: Path, directory: Path, *options: str) -> dict[str, object]:
    """The simulator's parameters of a file's run in one process."""
    run = ("run", "--clip", str(file), "--in-process", "--output", str(directory))
    assert main([*run, *options]) == 0
    (written,) = yaml.safe_load((directory / "parameters" / "sim_node.yaml").read_text()).values()
    parameters: dict[str, object] = written["ros__parameters"]
    return parameters


def hash_of(file: Path, directory: Path, *options: str) -> str:
    """The hash of the states of a file's run in one process."""
    simulated(file, directory, *options)
    return str(json.loads((directory / "summary.json").read_text())["state_hash"])


def changed(file: Path, tmp_path: Path, **made: object) -> Path:
    """A file, with other things said of how it was found."""
    content = json.loads(file.read_text())
    content["Reconstruction"].update(made)
    other = tmp_path / "changed.json"
    other.write_text(json.dumps(content))
    return other


def test_pushes_that_it_was_found_with_come_again_unless_others_are_given(
    kick: tuple[Path, Reconstruction], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, one = changed(kick[0], tmp_path, pushes=PUSHES), ("--push", PUSHES[0])

    known, known_said = hash_of(file, tmp_path / "known"), capsys.readouterr().out
    none = hash_of(file, tmp_path / "none", "--push", "none")
    other = hash_of(file, tmp_path / "other", *one)
    others_said = capsys.readouterr().out

    assert none == kick[1].metrics.state_hash != known
    assert other == hash_of(kick[0], tmp_path / "2", *one) not in (known, none)
    brought = f"brings {len(PUSHES)} pushes (--push none: without them)"
    assert brought in " ".join(known_said.split()) and "brings" not in others_said


def test_pushes_that_would_begin_at_the_end_or_later_are_left_out() -> None:
    plan = Problem("humanoid", "kick", 0.2).plan()

    assert not parse_pushes_within(["root:1,0,0@0.199", "root:1,0,0@0.2", "root:1,0,0@9"], plan)
    assert len(parse_pushes_within(["root:1,0,0@0.197"], plan)) == 1


def test_no_push_goes_with_no_other(
    kick: tuple[Path, Reconstruction], capsys: pytest.CaptureFixture[str]
) -> None:
    pushes = ("--push", "none", "--push", PUSHES[0])

    assert main(["run", "--clip", str(kick[0]), *pushes, "--in-process"]) != 0
    assert "--push none goes with no other" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("made", "reason"),
    [
        ({"duration": "long"}, "Reconstruction must have 'duration', 'parameters'"),
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
    kick: tuple[Path, Reconstruction],
    tmp_path: Path,
    made: dict[str, object],
    reason: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    file = changed(kick[0], tmp_path, **made)

    code = main(["run", "--clip", str(file), "--output", str(tmp_path / "run")])

    assert code == 1
    assert reason in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


# The command


def test_the_command_writes_a_file_and_a_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "kick.json"
    few = ("plan.samples:=12", "plan.rounds:=1", "plan.horizon:=0.3")

    code = main(
        [
            *("motion", "reconstruct", "--clip=kick"),
            *("--worlds=2", "--kept=1", "--workers=1"),
            f"--output={output}",
            *(f"--set=controller_node.{setting}" for setting in few),
        ]
    )

    printed = capsys.readouterr().out
    assert code == 0
    assert "centre of mass error" in printed
    assert f"play it over topics: actuated_characters run --clip {output}" in printed
    assert json.loads(output.read_text())["Reconstruction"]["clip"] == "kick"


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("--output", "walk.txt"), "it must end in .json"),
        (("--output", "no/walk.json"), "there is no directory"),
        (("--output", "there.json"), "exists; --resume goes on"),
        (("--output", "walk.json", "--workers", "0"), "--workers is 0"),
        (("--output", "walk.json", "--worlds", "0"), "--worlds is 0"),
        (("--output", "walk.json", "--kept", "9"), "--kept is 9; it must be 1 to 8"),
        (("--output", "walk.json", "--window", "0"), "--window is 0"),
        (("--output", "walk.json", "--seed", "-1"), "--seed is -1"),
        (("--output", "walk.json", "--cycles", "0"), "--cycles is 0"),
        (("--output", "walk.json", "--clip", "wlak"), "did you mean 'walk'"),
        (("--output", "walk.json", "--character", "franka_panda"), "franka_panda"),
        (("--output", "walk.json", "--resume"), "cannot resume from"),
        (("--output", "walk.json", "--push", "root:1,2"), "write it as LINK:FX,FY,FZ@S"),
        (("--output", "walk.json", "--push", "root:9,0,0@9"), "time is 9.0 s; it must be 0 s to"),
        (("--clip", "walk"), "reconstructions/humanoid-walk.json exists; --resume goes on"),
        ((*SET, "controller_node.law:=pd"), "'law' is pd"),
        ((*SET, "controller_node.law:=pd", "--workers", "2"), "'law' is pd"),
        ((*SET, "controller_node.planner:=none"), "reconstruct sets it itself"),
        ((*SET, "controller_node.reference:=hold"), "reconstruct sets it itself"),
        ((*SET, "sim_node.mode:=realtime"), "neither 'mode' realtime"),
    ],
)
def test_a_mistake_is_one_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    options: tuple[str, ...],
    reason: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.json").write_text("{}")
    (tmp_path / "reconstructions").mkdir()
    (tmp_path / "reconstructions" / "humanoid-walk.json").touch()

    alone = () if "--workers" in options else ("--workers", "1")
    code = main(["motion", "reconstruct", *options, *alone])

    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert code == 1
    assert last.startswith("error: ") and reason in last


@pytest.mark.parametrize(
    "early",
    [
        pytest.param(True, id="as processes begin"),
        pytest.param(False, id="later", marks=pytest.mark.nightly),
    ],
)
def test_ctrl_c_leaves_no_process_and_what_was_found(tmp_path: Path, *, early: bool) -> None:
    output, mark = tmp_path / "walk.json", f"{tmp_path}"
    few = [f"--set=controller_node.{name}:={value}" for name, value in QUICK.items()]
    process = subprocess.Popen(
        (
            *(sys.executable, "-m", "actuated_characters.cli", "motion", "reconstruct"),
            *("--worlds=4", "--workers=2", f"--output={output}", *few),
        ),
        cwd=PROJECT,
        env={**os.environ, "RECONSTRUCTION_TEST": mark},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        start_new_session=True,
        text=True,
    )
    try:
        wait_until(
            lambda: len(marked(mark)) > 2 and (early or checkpoint_path(output).exists()),
            "processes, and a checkpoint",
            240.0,  # compiled for the first time on a slow machine
        )
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does it
        _, printed = process.communicate(timeout=60.0)
    finally:
        process.kill()

    assert process.returncode == 130
    assert printed.strip().splitlines()[-1] == "interrupted"
    assert "Traceback" not in printed
    wait_until(lambda: not marked(mark), "the end of all processes")
    assert early or checkpoint_path(output).exists()


def marked(mark: str) -> list[int]:
    """Processes whose environment has a mark."""
    found = []
    for entry in Path("/proc").iterdir():
        with suppress(OSError):
            if (
                entry.name.isdecimal()
                and f"RECONSTRUCTION_TEST={mark}\0".encode() in (entry / "environ").read_bytes()
            ):
                found.append(int(entry.name))
    return found
