"""The search for a machine's parameters: where it moves numbers, and what it calls good."""

import sys
from pathlib import Path

import pytest
import yaml

from benchmarks.athletics import search
from benchmarks.athletics.trial import Walk
from controller_node.behaviours.state_machine.file import machine_path, make_machine, read_content
from msgs_config.errors import ConfigurationError

WALK = read_content(machine_path("walk"))


def test_a_number_is_moved_and_nothing_else() -> None:
    places = ["states.step.duration", "states.step.placement.width"]
    before = WALK["states"]["step"]

    moved = search.changed(WALK, places, [0.5, 0.2])

    step = make_machine(machine_path("walk"), moved).states["step"]
    assert (step.duration, step.placement.width) == (0.5, 0.2)
    numbers = [before["duration"], before["placement"]["width"]]
    assert search.changed(moved, places, numbers) == WALK


def test_a_key_with_a_dot_is_found() -> None:
    holder, key = search.place_of(WALK, "states.stand.targets.swing.elbow")

    assert holder[key] == 0.4


@pytest.mark.parametrize("place", ["states.step.width", "states.step", "gains.swing.hip"])
def test_what_is_no_number_is_said(place: str) -> None:
    with pytest.raises(ConfigurationError, match=f"there is no number at '{place}'"):
        search.place_of(WALK, place)


def test_a_fall_costs_more_than_any_walk_and_an_early_one_more_than_a_late_one() -> None:
    def walk(lasted: float, fell: bool, speed: float) -> Walk:
        return Walk(lasted, fell, speed, 0.6, 0.0, 0.0, 1.0)

    good, slow = (search.cost_of(walk(8.0, False, speed), 8.0) for speed in (0.6, 0.3))
    late, early = (search.cost_of(walk(lasted, True, 0.6), 8.0) for lasted in (6.0, 2.0))
    assert good < slow < late < early


@pytest.mark.parametrize("move", ["states.step.duration", "states.step.duration=much", "a=0"])
def test_a_wrong_move_is_one_clear_line(
    move: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["search", "--move", move])

    assert search.main() == 1

    error = capsys.readouterr().err
    assert f"--move {move}: it must be PLACE=STEP" in error and error.count("\n") == 1


def test_an_interruption_of_the_first_generation_does_not_pass_off_an_older_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found = tmp_path / "found.yaml"
    found.write_text("sides: {}\n")

    def interrupt(*given: object) -> float:
        raise KeyboardInterrupt

    monkeypatch.setattr(search, "_cost_or_worst", interrupt)
    monkeypatch.setattr(sys, "argv", ["search", "--output", str(found)])

    assert search.main() == 130

    assert "the best so far: none" in capsys.readouterr().err
    assert found.read_text() == "sides: {}\n"


@pytest.mark.slow
def test_a_generation_leaves_a_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search, "SECONDS", 5.0)
    found = tmp_path / "found.yaml"
    options = ["--generations", "1", "--population", "2", "--trials", "1", "--output", str(found)]
    monkeypatch.setattr(sys, "argv", ["search", *options])

    assert search.main() == 0

    moved = yaml.safe_load(found.read_text())
    assert moved != WALK
    assert make_machine(found, moved).states["step"].duration == pytest.approx(0.4, abs=0.1)
