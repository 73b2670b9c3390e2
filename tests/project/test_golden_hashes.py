"""Every golden run has the states that the table says, on this machine as on every other."""

from pathlib import Path

import pytest

from sim_node.physics.engine import INSTALLED_ENGINES
from tests.support import golden

TABLE = golden.golden()
QUICK = {"kuka_hold", "pendulum", "walk_reconstructed"}
NIGHTLY = {  # the others hold the same code
    *("planned_reactive_hit", "planned_active_ragdoll_hit", "planned_steered", "planned_backflip"),
    *("planned_walk", "planned_reactive_hit_short", "planned_backflip_short", "run_machine"),
    "planned_timeline",
    *("kick", "spin", "spinkick", "dance_a", "dance_b", "roll", "crawl", "punch", "getup_faceup"),
}
TAKES_LONG = {  # one engine each time: controllers know nothing of engines
    "hybrid_pushed": "mujoco",
    "jump_machine": "mujoco",
    "planned_active_ragdoll_hit_short": "bullet",
    "planned_reactive_hit_small": "mujoco",
    "planned_steered_short": "bullet",
    "planned_walk_short": "mujoco",
    "walk_machine": "bullet",
}
OVER_TOPICS = {  # of each kind; those with an engine each time
    "panda_sine": "bullet",
    "policy": "mujoco",
    "reactive_hit": "",
    "walk_480_delay": "",
    "walk_reconstructed": "",
}


def marks_of(name: str, engine: str) -> list[pytest.MarkDecorator]:
    is_one = len(INSTALLED_ENGINES) == 1
    if name in NIGHTLY or (TAKES_LONG.get(name, engine) != engine and not is_one):
        return [pytest.mark.nightly]
    return [] if name in QUICK else [pytest.mark.slow]


pytestmark = pytest.mark.skipif(not golden.HOLD_HERE, reason=golden.WHY_NOT)


def test_the_engines_are_those_of_the_table() -> None:
    expected = {name: TABLE["made_with"][name] for name in golden.engines()}

    assert golden.engines() == expected, "another engine may have other bits: make hashes"


@pytest.mark.parametrize(
    ("name", "engine"),
    [
        pytest.param(name, engine, marks=marks_of(name, engine))
        for name, run in TABLE["runs"].items()
        for engine in INSTALLED_ENGINES
        if engine in run
    ],
)
def test_a_golden_run_has_the_states_of_the_table(name: str, engine: str, tmp_path: Path) -> None:
    summary = golden.summary_here(golden.arguments_of(name, engine), tmp_path / "run")

    assert_as_in_the_table(name, engine, summary)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "engine"),
    [
        pytest.param(name, engine, marks=[] if engine == each_time else pytest.mark.nightly)
        for name, each_time in OVER_TOPICS.items()
        for engine in INSTALLED_ENGINES
    ],
)
def test_over_topics_it_has_them_too(name: str, engine: str, domain: int, tmp_path: Path) -> None:
    del domain
    summary = golden.summary_over_topics(golden.arguments_of(name, engine), tmp_path / "run")

    assert_as_in_the_table(name, engine, summary)


def assert_as_in_the_table(name: str, engine: str, summary: dict[str, object]) -> None:
    wanted = TABLE["runs"][name][engine]
    found = {key: summary[key] for key in wanted}
    assert found == wanted, f"made with {TABLE['made_with']}, here {golden.made_with()}"
