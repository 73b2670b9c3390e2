"""Every golden run has the states that the table says, on this machine as on every other."""

from pathlib import Path

import golden
import pytest

TABLE = golden.golden()
QUICK = {"kuka_hold", "pendulum", "walk_reconstructed"}

pytestmark = pytest.mark.skipif(not golden.HOLD_HERE, reason=golden.WHY_NOT)


def test_the_engines_are_those_of_the_table() -> None:
    expected = {name: TABLE["made_with"][name] for name in golden.ENGINES}

    assert golden.engines() == expected, "another engine may have other bits: make hashes"


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in TABLE["runs"]],
)
def test_a_golden_run_has_the_states_of_the_table(name: str, tmp_path: Path) -> None:
    expected = TABLE["runs"][name]

    summary = golden.summary_of(expected["arguments"], tmp_path / "run")

    found = {key: summary[key] for key in expected if key != "arguments"}
    wanted = {key: value for key, value in expected.items() if key != "arguments"}
    assert found == wanted, f"made with {TABLE['made_with']}, here {golden.made_with()}"
