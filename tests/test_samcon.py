"""Sampling-based motion control: its parts, and a search that is small enough for a test."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from physics import character
from ros import wait_until

from controller_node.references.corrected_file import read_corrections, read_reconstruction
from experiment.cli import main
from experiment.loop import ticks_in_process
from experiment.metrics import StateHash
from experiment.samcon import cost
from experiment.samcon import search as samcon_search
from experiment.samcon.checkpoint import checkpoint_path
from experiment.samcon.features import Features, end_effectors
from experiment.samcon.problem import Problem, Windows
from experiment.samcon.reconstruction import Job, Reconstruction, duration_of, reconstruct
from experiment.samcon.rollout import Branch, Rollout
from experiment.samcon.search import Progress
from experiment.samcon.settings import Bounds, Settings, Weights, preset, settings_from
from experiment.samcon.tree import chosen
from experiment.samcon.workers import Workers
from msgs_config.arrays import FloatArray
from msgs_config.errors import ActuatedCharactersError, ConfigurationError, RunError

pytestmark = pytest.mark.slow

PROJECT = Path(__file__).parents[1]
HUMANOID = character("humanoid")
LAYOUT = HUMANOID.layout
PROBLEM = Problem("humanoid", "walk", duration=0.3, window=0.1)
SMALL = preset("humanoid", "walk", samples=12, kept=4)
NO_ROOT = {"root_assistance": False}


@pytest.fixture(scope="module")
def rollout() -> Iterator[Rollout]:
    rollout = Rollout(PROBLEM)
    yield rollout
    rollout.close()


def offsets(count: int) -> FloatArray:
    """Offsets (s, n) of the knees."""
    rng = np.random.default_rng(5)
    knees = LAYOUT.mask(("right_knee", "left_knee"))
    return np.where(knees, rng.uniform(-0.3, 0.3, (count, LAYOUT.size)), 0.0)


# Windows


@pytest.mark.parametrize(
    ("ticks", "window", "count"), [(312, 0.1, 13), (24, 0.1, 1), (5, 0.1, 1), (305, 0.1, 13)]
)
def test_windows_share_the_ticks_about_evenly(ticks: int, window: float, count: int) -> None:
    windows = Windows(ticks, 240, window)

    lengths = np.diff(windows.bounds)
    assert len(windows) == count == len(windows.ends)
    assert windows.bounds[0] == 0
    assert lengths.sum() == ticks
    assert lengths.max() - lengths.min() <= 1
    assert windows.ends == pytest.approx(windows.bounds[1:] / 240.0, abs=1e-8)


# Rollouts


def test_the_same_sample_ends_in_the_same_state_whoever_went_before(rollout: Rollout) -> None:
    path, samples = offsets(2), offsets(4)
    nothing = np.zeros(LAYOUT.size)

    from_first = rollout.expand(Branch(None, 0, path, nothing, samples))
    from_snapshot = rollout.expand(
        Branch(from_first.snapshot, 2, path[:0], path[1], samples[::-1].copy())
    )

    assert from_snapshot.start.tobytes() == from_first.start.tobytes()
    assert from_snapshot.features[::-1].tobytes() == from_first.features.tobytes()


def test_other_processes_get_the_same_numbers(rollout: Rollout) -> None:
    nothing = np.zeros(LAYOUT.size)
    branches = [Branch(None, 0, path[np.newaxis], nothing, offsets(3)) for path in offsets(3)]
    alone = [rollout.expand(branch) for branch in branches]

    with Workers(PROBLEM, 2) as workers:
        together = list(workers.expand(branches))

    for one, other in zip(alone, together, strict=True):
        assert one.features.tobytes() == other.features.tobytes()
        assert one.start.tobytes() == other.start.tobytes()


def test_samples_that_diverge_have_no_features() -> None:
    wary = Rollout(replace(PROBLEM, simulator={"speed_limit": 0.5}))

    expansion = wary.expand(Branch(None, 0, offsets(0), np.zeros(LAYOUT.size), offsets(2)))

    wary.close()
    assert np.isnan(expansion.features).all()


# Costs


def test_end_effectors_are_feet_hands_and_head() -> None:
    names = [HUMANOID.links[index].name for index in end_effectors(HUMANOID)]

    assert sorted(names) == ["left_ankle", "left_wrist", "neck", "right_ankle", "right_wrist"]


def terms_of(position: FloatArray, velocity: FloatArray, desired: FloatArray) -> cost.Terms:
    row = Features(HUMANOID).row(position, velocity)
    return cost.terms(LAYOUT, 0.9, row[np.newaxis], desired, Bounds())


def test_the_motion_itself_costs_nothing(rollout: Rollout) -> None:
    state = rollout.plan.reference.sample(rollout.windows.ends[1])

    found = terms_of(state.configuration.position, state.velocity, rollout.desired(1))

    assert found.lost[0] == 0.0
    assert found.cost(Weights())[0] == pytest.approx(0.0, abs=1e-9)


def test_a_shift_costs_its_length_and_nothing_else(rollout: Rollout) -> None:
    state = rollout.plan.reference.sample(rollout.windows.ends[1])
    position = state.configuration.position.copy()
    position[:2] += (0.03, -0.04)

    found = terms_of(position, state.velocity, rollout.desired(1))

    assert found.centre[0] == pytest.approx(0.05)
    assert found.ahead[0] == pytest.approx(0.05)
    for other in (found.pose, found.root, found.end_effectors, found.balance):
        assert other[0] == pytest.approx(0.0, abs=1e-9)


def test_a_bent_knee_costs_its_share_of_the_pose_and_a_higher_foot(rollout: Rollout) -> None:
    state = rollout.plan.reference.sample(rollout.windows.ends[1])
    position, knee = state.configuration.position.copy(), LAYOUT.joint("right_knee").start
    position[knee] -= 0.6

    found = terms_of(position, state.velocity, rollout.desired(1))

    assert found.pose[0] == pytest.approx(0.6 / len(LAYOUT.actuated_joint_names))
    assert found.root[0] == pytest.approx(0.0, abs=1e-9)
    assert found.end_effectors[0] > 0.01
    assert found.balance[0] > 0.01


@pytest.mark.parametrize(
    ("entry", "change"), [("root_x", 0.45), ("root_z", -0.5), ("root_rx", 1.3), ("root_y", np.nan)]
)
def test_what_is_too_far_away_is_lost(rollout: Rollout, entry: str, change: float) -> None:
    state = rollout.plan.reference.sample(rollout.windows.ends[1])
    position = state.configuration.position.copy()
    row, size = rollout.desired(1).copy(), LAYOUT.size
    position[LAYOUT.dof_names.index(entry)] += change
    if np.isfinite(change):
        row = Features(HUMANOID).row(position, state.velocity)
    row[:size] = position

    found = cost.terms(LAYOUT, 0.9, row[np.newaxis], rollout.desired(1), Bounds())

    assert found.cost(Weights())[0] == np.inf


# Which samples are kept


def test_the_best_is_kept_first_then_ever_worse_ones_none_twice() -> None:
    costs = np.random.default_rng(1).permutation(1000.0 + np.arange(1000.0))

    kept = costs[chosen(costs, 40, 0.4)]

    assert len(kept) == 40
    assert kept[0] == 1000.0
    assert (np.diff(kept) >= 1.0).all()
    assert kept[-1] == 1399.0  # the worst of the good ones
    assert np.median(kept) < 1100.0


@pytest.mark.parametrize(("finite", "kept"), [(0, 0), (3, 3), (10, 5)])
def test_what_is_lost_is_never_kept(finite: int, kept: int) -> None:
    costs = np.full(20, np.inf)
    costs[5 : 5 + finite] = 1.0

    found = chosen(costs, 5, 0.4)

    assert found == list(range(5, 5 + kept))


# Settings


def test_a_clips_feedback_is_its_own() -> None:
    walk, kick = preset("humanoid", "walk"), preset("humanoid", "kick")

    assert walk.feedback != kick.feedback
    assert walk.noise == kick.noise
    assert preset("humanoid", "walk", feedback={}).feedback == {}


def test_a_control_rate_may_have_settings_of_its_own() -> None:
    walk, faster = preset("humanoid", "walk"), preset("humanoid", "walk", 480)

    assert preset("humanoid", "walk", 240) == walk
    assert faster.gains != walk.gains
    assert preset("humanoid", "kick", 480) == preset("humanoid", "kick")


def test_settings_are_what_their_content_says() -> None:
    content = json.loads(json.dumps(SMALL.content()))

    assert settings_from(content) == SMALL


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"samples": 0}, "samples is 0; it must be 1 to"),
        ({"window": 0.0}, "window is 0"),
        ({"kept": -1}, "kept is -1"),
        ({"sampels": 10}, "unknown setting 'sampels'"),
    ],
)
def test_a_wrong_setting_is_refused(given: dict[str, object], reason: str) -> None:
    with pytest.raises(ConfigurationError, match=reason):
        preset("humanoid", "walk", **given)


# A whole search


def job(output: Path, settings: Settings = SMALL, workers: int = 1) -> Job:
    return Job(PROBLEM, cycles=1, settings=settings, output=output, workers=workers)


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Reconstruction]:
    output = tmp_path_factory.mktemp("samcon") / "walk.json"
    return output, reconstruct(job(output))


def test_a_run_of_the_file_is_the_reconstruction_bit_for_bit(
    found: tuple[Path, Reconstruction],
) -> None:
    output, reconstruction = found
    digest = StateHash()
    for count, tick in enumerate(ticks_in_process(PROBLEM.plan(str(output)))):
        if not count:
            digest.add(tick.state)
        digest.add(tick.following)

    made = read_reconstruction(output)
    assert digest.hexdigest() == reconstruction.figures.state_hash
    assert made["figures"]["state_hash"] == digest.hexdigest()
    assert made["complete"] and len(made["costs"]) == 3
    assert reconstruction.figures.assist_force_mean_n == 0.0
    assert [path.name for path in output.parent.iterdir()] == ["walk.json"]


def test_the_search_costs_less_than_the_motion_without_corrections(
    found: tuple[Path, Reconstruction], tmp_path: Path
) -> None:
    output = tmp_path / "walk.json"

    alone = reconstruct(job(output, replace(SMALL, samples=1, kept=1)))

    corrections = read_corrections(HUMANOID, str(output))
    assert corrections is not None and not corrections.offsets.any()
    assert found[1].cost < alone.cost


def test_who_was_never_corrected_goes_on_however_few_the_samples(tmp_path: Path) -> None:
    last: list[Progress] = []
    settings = replace(SMALL, samples=4, kept=20)
    problem = replace(PROBLEM, duration=0.6)

    reconstruct(Job(problem, 1, settings, tmp_path / "w.json"), lambda now, *_: last.append(now))

    assert any(not node.offsets.any() for node in last[-1].levels[-1])


def test_a_look_ahead_is_what_comes_without_a_correction(rollout: Rollout) -> None:
    samples, nothing = offsets(2), np.zeros(LAYOUT.size)

    seen = rollout.expand(Branch(None, 0, samples[:0], nothing, samples, lookahead=3)).features

    assert seen.shape[:2] == (2, 4)
    for row, sample in zip(seen, samples, strict=True):
        path = np.array((sample, nothing))
        later = rollout.expand(Branch(None, 0, path[:1], nothing, path[1:])).features
        assert row[1].tobytes() == later[0, 0].tobytes()
    assert np.isnan(seen[:, 3]).all()  # the run has three windows


def test_the_number_of_processes_does_not_matter(
    found: tuple[Path, Reconstruction], tmp_path: Path
) -> None:
    reconstruct(job(tmp_path / "walk.json", workers=2))

    assert (tmp_path / "walk.json").read_text() == found[0].read_text()


def test_a_seed_matters(found: tuple[Path, Reconstruction], tmp_path: Path) -> None:
    other = reconstruct(job(tmp_path / "walk.json", replace(SMALL, seed=2)))

    assert other.figures.state_hash != found[1].figures.state_hash


@pytest.mark.parametrize("stopped_after", [1, 2])
def test_a_stopped_search_resumes_to_the_same_result(
    found: tuple[Path, Reconstruction], tmp_path: Path, stopped_after: int
) -> None:
    output = tmp_path / "walk.json"

    def stop(progress: Progress, windows: int, rate: float) -> None:
        if progress.window == stopped_after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        reconstruct(job(output), stop)
    assert checkpoint_path(output).exists()
    assert not output.exists()

    reconstruct(replace(job(output), resume=True))

    assert output.read_text() == found[0].read_text()
    assert not checkpoint_path(output).exists()


def test_another_search_cannot_be_resumed(tmp_path: Path) -> None:
    def stop(progress: Progress, windows: int, rate: float) -> None:
        if progress.window:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        reconstruct(job(tmp_path / "walk.json"), stop)

    with pytest.raises(ConfigurationError, match="whose seed is 1, not 9"):
        reconstruct(replace(job(tmp_path / "walk.json", replace(SMALL, seed=9)), resume=True))


def test_what_cannot_be_done_ends_with_the_best_attempt(tmp_path: Path) -> None:
    output = tmp_path / "walk.json"
    strict = replace(SMALL, bounds=Bounds(centre=0.02), tries=3, samples=4)

    with pytest.raises(RunError, match=r"3 failures .* window \d of 3 .*lost.*the best attempt"):
        reconstruct(job(output, strict))

    made = read_reconstruction(output)
    corrections = read_corrections(HUMANOID, str(output))
    assert corrections is not None
    assert not made["complete"] and made["figures"] is None
    assert len(corrections.ends) == len(made["costs"])
    assert checkpoint_path(output).exists()


STRICT = replace(SMALL, bounds=Bounds(centre=0.05), tries=4, samples=4, kept=1, lookahead=0)
"""With them a walk of 1.2 s gets stuck."""


def stuck(output: Path, *, resume: bool = False) -> Job:
    problem = replace(PROBLEM, duration=1.2, window=0.05)
    return Job(problem, 1, STRICT, output, resume=resume)


@pytest.mark.parametrize("furthest", [32, 4])
def test_who_is_stuck_goes_back_twice_as_far_each_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, furthest: int
) -> None:
    monkeypatch.setattr(samcon_search, "_FURTHEST_BACK", furthest)
    monkeypatch.setattr(samcon_search, "_REACH", furthest - 1)  # some have to be simulated again
    told: list[tuple[int, int, int]] = []

    with pytest.raises(RunError, match="4 failures"):
        reconstruct(
            stuck(tmp_path / "w.json"),
            lambda now, *_: told.append((now.window, now.failures, now.stuck)),
        )

    backs = [
        (before - window, stuck, before)
        for (before, failed, _), (window, failures, stuck) in pairwise(told)
        if failures > failed
    ]
    assert [stuck for _, stuck, _ in backs][-3:] == [1, 2, 3]
    assert all(back == min(2**stuck, furthest, before) for back, stuck, before in backs)
    assert max(back for back, _, _ in backs) > 2


def test_who_is_stuck_resumes_to_the_same_end(tmp_path: Path) -> None:
    whole, parts = tmp_path / "whole.json", tmp_path / "parts.json"

    def stop(progress: Progress, *_: float) -> None:
        if progress.stuck == 2:
            raise KeyboardInterrupt

    with pytest.raises(RunError, match="4 failures") as found:
        reconstruct(stuck(whole))
    with pytest.raises(KeyboardInterrupt):
        reconstruct(stuck(parts), stop)
    with pytest.raises(RunError) as resumed:
        reconstruct(stuck(parts, resume=True))

    assert str(resumed.value).replace("parts", "whole") == str(found.value)
    assert parts.read_text() == whole.read_text()


def test_only_a_clip_that_wraps_has_cycles() -> None:
    assert duration_of("humanoid", "walk", 3) == pytest.approx(3 * 1.2667, abs=1e-3)
    with pytest.raises(ActuatedCharactersError, match="the clip 'kick' ends, it must be 1"):
        duration_of("humanoid", "kick", 2)


# The command


def test_the_command_writes_a_file_and_a_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "kick.json"
    few = ("--samples", "2", "--kept", "1", "--window", "0.8", "--workers", "1", "--seed", "3")

    code = main(["reconstruct", "--clip", "kick", *few, "--output", str(output)])

    said = capsys.readouterr()
    if code:  # so few samples may well fall
        assert "failures without getting any further" in said.err
    else:
        assert "centre of mass error" in said.out
    assert read_reconstruction(output)["clip"] == "kick"


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("--output", "walk.txt"), "it must end in .json"),
        (("--output", "no/walk.json"), "there is no directory"),
        (("--output", "there.json"), "exists; --resume goes on"),
        (("--output", "walk.json", "--workers", "0"), "--workers is 0"),
        (("--output", "walk.json", "--samples", "0"), "samples is 0"),
        (("--output", "walk.json", "--cycles", "0"), "--cycles is 0"),
        (("--output", "walk.json", "--clip", "wlak"), "did you mean 'walk'"),
        (("--output", "walk.json", "--character", "franka_panda"), "franka_panda"),
        (("--output", "walk.json", "--resume"), "cannot resume from"),
        (("--output", "walk.json", "--push", "root:1,2"), "write it as LINK:FX,FY,FZ@S"),
        (("--output", "walk.json", "--push", "root:9,0,0@9"), "time is 9.0 s; it must be 0 s to"),
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

    code = main(["reconstruct", *options, *(() if "--workers" in options else ("--workers", "1"))])

    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert code == 1
    assert last.startswith("error: ") and reason in last


def test_ctrl_c_leaves_a_checkpoint_and_no_process(tmp_path: Path) -> None:
    output, mark = tmp_path / "walk.json", f"{tmp_path}"
    options = ("--samples", "8", "--kept", "2", "--workers", "2", "--output", str(output))
    process = subprocess.Popen(
        (sys.executable, "-m", "experiment.cli", "reconstruct", *options),
        cwd=PROJECT,
        env={**os.environ, "SAMCON_TEST": mark},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        start_new_session=True,
        text=True,
    )
    try:
        wait_until(
            lambda: checkpoint_path(output).exists() or process.poll() is not None, "a checkpoint"
        )
        workers = marked(mark)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does it
        _, said = process.communicate(timeout=60.0)
    finally:
        process.kill()

    assert process.returncode == 130
    assert said.strip().splitlines()[-1] == "interrupted"
    assert "Traceback" not in said
    assert len(workers) > 2
    wait_until(lambda: not marked(mark), "the end of all processes")
    assert checkpoint_path(output).exists()


def marked(mark: str) -> list[int]:
    """Processes whose environment has a mark."""
    found = []
    for entry in Path("/proc").iterdir():
        with suppress(OSError):
            if (
                entry.name.isdecimal()
                and f"SAMCON_TEST={mark}\0".encode() in (entry / "environ").read_bytes()
            ):
                found.append(int(entry.name))
    return found
