"""The figures of a run show what its character has: no empty panel, no dash in place of a value."""

from pathlib import Path

import numpy as np
import pytest

from actuated_characters.cli import main
from actuated_characters.metrics.run_metrics import COLUMNS
from actuated_characters.recorder.run_directory import read_metrics
from actuated_characters.report.metrics_plot import describe_metrics, draw_metrics

RUN = ("run", "--in-process", "--duration", "0.2")
PANELS = {
    "lift": {"sliders (m)", "force of sliders (N)"},
    "pendulum": {"joint error (rad)", "effort"},
    "franka_panda": {"joint error (rad)", "sliders (m)", "force of sliders (N)", "effort"},
    "humanoid": {"joint error (rad)", "root error (m)", "root height (m)", "effort"},
}


def run(directory: Path, *arguments: str) -> None:
    assert main([*RUN, *arguments, "--output", str(directory)]) == 0


@pytest.mark.parametrize("character", PANELS)
def test_the_plot_has_a_panel_for_each_quantity_that_there_is(
    tmp_path: Path, character: str
) -> None:
    run(tmp_path / "run", "--character", character)

    panels = draw_metrics(*read_metrics(tmp_path / "run")).axes

    assert {panel.get_ylabel() for panel in panels} == PANELS[character]
    for panel in panels:
        assert panel.lines
        for line in panel.lines:
            assert np.isfinite(np.asarray(line.get_ydata(), dtype=float)).any()


def test_a_lifts_height_is_measured_against_its_target(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    pid = ("--set", "controller_node.law:=pid", "--set", "controller_node.gains.height.i:=100")
    run(tmp_path / "run", "--character", "lift", *pid)

    summary, series = read_metrics(tmp_path / "run")

    apart = np.abs(series["position.height"] - series["reference_position.height"])
    assert summary["slider_error_mean_m"] == pytest.approx(apart.mean(), rel=1e-6)
    assert summary["slider_error_max_m"] == pytest.approx(apart.max(), rel=1e-6)
    assert apart.max() > 0.01
    assert series["effort.height"][-1] == pytest.approx(9.81, rel=0.2)  # it carries 1 kg
    assert summary["joint_error_mean_rad"] is None
    table = capsys.readouterr().out
    assert f"{apart.mean():.4g} │" in table and table.count("- │") == 1  # its base is fixed
    assert not any(name in table for name in ("joint_error", "root_error", "fell_"))


def test_a_run_without_a_tick_has_a_plot_too() -> None:
    series = dict.fromkeys(COLUMNS, np.zeros(0))

    figure = draw_metrics({"character": "none", "ticks": 0, "body_weight_n": 9.81}, series)

    assert not figure.axes[0].lines


@pytest.mark.parametrize(
    ("of_root", "told"), [(6, "34, 6 of them the root's assistance"), (0, "34")]
)
def test_actuators_of_the_root_are_told_apart(of_root: int, told: str) -> None:
    metrics = describe_metrics(
        {"actuators": 34, "root_actuators": of_root, "fell": None, "lost_messages": {}}
    )

    assert metrics == [("actuators", told), ("fell", "-"), ("lost_messages", "none")]
