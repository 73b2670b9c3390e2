"""A reconstruction played over topics: real nodes, the same doubles."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from experiment.cli import main
from experiment.samcon.problem import Problem
from experiment.samcon.reconstruction import Job, reconstruct
from experiment.samcon.settings import preset

DURATION = 0.3  # s


@pytest.mark.parametrize(("rate", "delay"), [(240, 0), (480, 1)])
def test_over_topics_it_is_what_was_found_bit_for_bit(
    domain: int, tmp_path: Path, rate: int, delay: int
) -> None:
    del domain
    settings = replace(preset("humanoid", "walk", samples=8, kept=2), lookahead=0)
    simulator = {"rate": rate, "command_delay_ticks": delay}
    problem = Problem("humanoid", "walk", DURATION, 0.1, simulator, feedback=settings.feedback)
    file, directory = tmp_path / "walk.json", tmp_path / "run"
    found = reconstruct(Job(problem, 1, settings, file))

    code = main(
        [
            *("run", "--clip", str(file), "--duration", f"{DURATION}"),
            *("--set", "controller_node.root_assistance:=false", "--output", str(directory)),
            *("--set", f"sim_node.rate:={rate}"),
            *("--set", f"sim_node.command_delay_ticks:={delay}"),
        ]
    )

    summary = json.loads((directory / "summary.json").read_text())
    assert code == 0
    assert any(settings.feedback.values())
    assert summary["ticks"] == round(DURATION * rate) == found.figures.ticks
    assert summary["actuators"] == summary["degrees_of_freedom"] - 6
    assert summary["state_hash"] == found.figures.state_hash
