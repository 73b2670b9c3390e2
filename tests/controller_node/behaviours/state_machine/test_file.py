"""What is wrong in a machine's file is one line before anything starts."""

from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from actuated_characters.runs.plan import make_plan
from controller_node.behaviours.state_machine.check import check_machine
from controller_node.behaviours.state_machine.file import read_machine, shipped_machines
from msgs_config.errors import ConfigurationError
from tests.support.physics import character

HUMANOID = character("humanoid")
SIDES = {
    side: {part: f"{side}_{part}" for part in ("hip", "knee", "ankle")}
    for side in ("right", "left")
}
STANDING = {"stance": "stand", "swing": "stand"}


def machine(**changes: Any) -> dict[str, Any]:
    """Stands for a second, then on the right leg, and so on."""
    states = {
        "both": {
            "feet": STANDING,
            "root": {"height": 0.8},
            "ends": [{"when": {"time": "> 1"}, "then": "one"}],
        },
        "one": {
            "feet": {"stance": "stand", "swing": "step"},
            "root": {"height": 0.8},
            "targets": {"swing.knee": -0.5},
            "ends": [{"when": {"swing_load": "> 30"}, "then": "both", "swap": True}],
        },
    }
    content = {"sides": deepcopy(SIDES), "start": "both", "states": states}
    for path, value in changes.items():
        *keys, last = path.split("__")
        place: Any = content
        for key in keys:
            place = place[int(key) if key.isdigit() else key]
        if value is None:
            del place[last]
        else:
            place[last] = value
    return content


def read(tmp_path: Path, content: dict[str, Any]) -> None:
    file = tmp_path / "machine.yaml"
    file.write_text(yaml.safe_dump(content))
    check_machine(read_machine(str(file)), HUMANOID)


def test_a_machine_is_read(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    file.write_text(yaml.safe_dump(machine()))

    found = read_machine(str(file))

    check_machine(found, HUMANOID)
    assert list(found.states) == ["both", "one"]
    assert found.states["both"].ends[0].then == "one"


@pytest.mark.parametrize("name", shipped_machines())
def test_each_shipped_machine_can_be_planned(name: str) -> None:
    plan = make_plan("humanoid", 1.0, {}, {}, {"behaviour": "state_machine", "machine": name})

    assert plan.controller["reference"] == "steered"
    assert "root" not in plan.simulator["commanded_joints"]
    assert plan.simulator["contact_breaking_threshold"] == 0.1


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"start": "bth"}, "start: unknown state 'bth'; did you mean 'both'? there are: both, one"),
        (
            {"states__both__ends__0__then": "two"},
            "states.both.ends: unknown state 'two'; there are: both, one",
        ),
        (
            {"states__one__targets": {"swing.kne": -0.5}},
            "states.one.targets: unknown joint 'swing.kne'; did you mean 'swing.knee'?",
        ),
        (
            {"states__one__gains": {"tail": [10, 1]}},
            "states.one.gains: unknown joint 'tail'; there are: chest, neck,",
        ),
        (
            {"sides__left__hip": "left_hop"},
            "sides.left.hip: unknown joint 'left_hop'; did you mean 'left_hip'?",
        ),
        ({"sides__left__ankle": None}, "sides is a dict; it must be 'left' and 'right'"),
        ({"sides__left": {"hip": "left_hip", "shoulder": "left_shoulder"}}, "each with a hip, a"),
        ({"sides__left__tail": "neck"}, "sides.tail is None; it must be a joint of both sides"),
        (
            {"states__one__ends": None},
            "states.one.ends is None; it must be a list of one end or more, or 'never'",
        ),
        ({"states__one__ends": []}, "it must be a list of one end or more, or 'never'"),
        (
            {"states__both__ends__0__when": {"height": "> 0.5"}},
            "states both -> one -> both may follow each other without time; give one of their ends "
            "a condition such as {time: '> 0.1'}",
        ),
        (
            {"states__lost": machine()["states"]["both"]},
            "states.lost: no state ends in it",
        ),
        (
            {"states__both__ends__0__when": {"time": 1}},
            "when.time is 1; it must be '> NUMBER' or '< NUMBER', s in the state",
        ),
        ({"states__both__ends__0__when": {"tim": "> 1"}}, "unknown key"),
        ({"states__both__ends__0__when": {}}, "it must be conditions, such as {time: '> 0.5'}"),
        ({"states__both__root": {}}, "states.both.root.height is None; it must be a finite number"),
        ({"states__one__feet__swing": "hop"}, "feet.swing is 'hop'; it must be 'stand' or"),
        ({"states__one__feet__swing": "reach"}, "a foot that reaches needs 'placement.length'"),
        ({"states__one__placement": {"law": "guess"}}, "placement.law is 'guess'; it must be"),
        ({"states__one__placement": {"origin": "toe"}}, "placement.origin is 'toe'; it must be"),
        ({"changes": {"bth": {}}}, "changes: unknown state 'bth'; did you mean 'both'?"),
        (
            {"changes": {"both": {"root": {"height": -1}}}},
            "changes.both.root.height is -1; it",
        ),
        ({"changes": {"both": {"ends": []}}}, "unknown key 'changes.both.ends'; there are: "),
        ({"changes": {"one": {"placement": {"law": "guess"}}}}, "changes.one.placement.law is 'gu"),
        ({"joins": {"bth": []}}, "joins: unknown state 'bth'; did you mean 'both'?"),
        ({"joins": {"both": []}}, "joins.both is a list; it must be a list of one end or more"),
        ({"states__one__placement": {"wdith": 0.2}}, "unknown key 'states.one.placement.wdith'"),
        (
            {"states__one__targets": {"swing.knee": {"pitch": 0.4}}},
            "targets.swing.knee: roll, pitch and yaw are for a ball joint; it is revolute",
        ),
        (
            {"states__one__targets": {"chest": 0.4}},
            "targets.chest: it is spherical, and must have three numbers",
        ),
        (
            {"states__one__efforts": {"stance.hip": "balance"}},
            "efforts.stance.hip is 'balance', which goes with 'tracks: true'",
        ),
        (
            {"states__one__efforts": {"stance.hip": 3.0}},
            "efforts.stance.hip: it is spherical, and must have three numbers, N m",
        ),
        (
            {"states__one__efforts": {"swing.knee": [1.0, 2.0, 3.0]}},
            "efforts.swing.knee: it is revolute, and must have one number, N m",
        ),
        ({"states__one__tracks": True}, "a state that tracks has no foot that stands"),
        ({"states": {}}, "states is a dict; it must be a mapping of one state or more"),
        ({"limits": {"sideways": 0.3}}, "unknown key 'limits.sideways'; did you mean 'aside'?"),
        ({"limits": {"turn": -1}}, "limits.turn is -1; it must be a finite number from 0 to 1000"),
        ({"includes": {"walk": "wlak"}}, "unknown machine 'wlak'; did you mean 'walk'?"),
        ({"includes": {"again": "machine.yaml"}}, "more than 8 files include each other"),
    ],
)
def test_what_is_wrong_is_one_line_with_the_place(
    tmp_path: Path, changes: dict[str, Any], says: str
) -> None:
    with pytest.raises(ConfigurationError) as raised:
        read(tmp_path, machine(**changes))

    line = str(raised.value)
    assert line.startswith((f"{tmp_path}", "unknown machine")) and "\n" not in line
    assert says in line


def test_states_of_an_included_machine_have_its_prefix(tmp_path: Path) -> None:
    content = machine(
        includes={"walk": "walk"},
        sides=yaml.safe_load((Path(read_machine("walk").file)).read_text())["sides"],
        states__one__ends__0__then="walk.stand",
    )
    file = tmp_path / "machine.yaml"
    file.write_text(yaml.safe_dump(content))

    states = read_machine(str(file)).states

    assert {"both", "one", "walk.stand", "walk.step"} <= set(states)
    assert all(end.then in states for state in states.values() for end in state.ends)


def test_what_changes_of_an_included_state_is_what_is_said() -> None:
    walk, rough = read_machine("walk").states["step"], read_machine("rough").states["walk.step"]

    assert (rough.placement.clearance, rough.placement.descent) == (0.16, 1.0)
    kept = replace(rough.placement, clearance=0.1, descent=0.5)
    assert (kept, rough.root, rough.pressure) == (walk.placement, walk.root, walk.pressure)
    assert (rough.duration, rough.targets) == (walk.duration, walk.targets)


def test_a_join_ends_an_included_state_before_its_own_ends(tmp_path: Path) -> None:
    content = machine(
        includes={"walk": "walk"},
        joins={
            "walk.step": [
                {"when": {"time": "> 0.1", "speed": "> 0.9"}, "then": "one", "swap": True}
            ]
        },
        sides=yaml.safe_load((Path(read_machine("walk").file)).read_text())["sides"],
        states__one__ends__0__then="walk.stand",
    )
    file = tmp_path / "machine.yaml"
    file.write_text(yaml.safe_dump(content))

    joined = read_machine(str(file))

    first, *others = joined.states["walk.step"].ends
    assert (first.then, first.swap) == ("one", True)
    assert [end.then for end in others] == [
        f"walk.{end.then}" for end in read_machine("walk").states["step"].ends
    ]
    check_machine(joined, HUMANOID)


@pytest.mark.parametrize(
    ("controller", "says"),
    [
        ({"machine": "wlak"}, "unknown machine 'wlak'; did you mean 'walk'?"),
        ({"reference": "hold"}, "needs 'reference' to be steered; it is hold"),
        ({"law": "pd"}, "needs 'law' to be stable_pd; it is pd"),
        ({"planner": "predictive"}, "needs 'planner' to be none; it is predictive"),
        ({"command_delay_ticks": 1}, "needs 'command_delay_ticks' to be 0"),
        ({"gravity": 0.0}, "needs 'gravity' to be more than 0"),
    ],
)
def test_other_parameters_that_do_not_go_with_a_machine_are_said(
    controller: dict[str, object], says: str
) -> None:
    with pytest.raises(ConfigurationError, match=says):
        make_plan("humanoid", 1.0, {}, {}, {"behaviour": "state_machine", **controller})


def test_a_character_without_legs_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="unknown joint 'right_hip'"):
        check_machine(read_machine("walk"), character("laikago"))
    with pytest.raises(ConfigurationError, match="needs a floating base"):
        make_plan("pendulum", 1.0, {}, {}, {"behaviour": "state_machine"})
