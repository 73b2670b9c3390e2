"""Stubs fail, solutions have all points, and wrong ones what they deserve."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from lecture.labs.catalogue import LABS, stub_of
from tests.lecture.labs.grading import grade, solution

pytestmark = [pytest.mark.slow]

# The first digits of each solution's hash of states, the same with every Python and processor.
HASHES = {
    "lab1": "3e916f0439efbb70",
    "lab2": "d0e77e177b008939",
    "lab3": "edb099942b53f131",
    "lab4": "2ac6ffa90f4ec9c6",
    "lab5": "aba2382d0bdf1469",
    "lab6": "4858bdd400683198",
}

# By lab: what is wrong, which words of the solution become which, and the points.
WRONG = [
    ("lab1", "no damping", (("+ damping * error_rate", "+ 0.0 * error_rate"),), 0),
    ("lab1", "half of the critical damping", (("2.0 * math.sqrt", "1.0 * math.sqrt"),), 70),
    ("lab1", "the integral's sign", (("+ integral_gain", "- integral_gain"),), 80),
    (
        "lab2",
        "explicit PD",
        (("known - period * damping * acceleration", "stiffness * error - damping * velocity"),),
        0,
    ),
    ("lab2", "the error of now", (("(error - period * velocity)", "error"),), 70),
    ("lab2", "the bias force's sign", (("known - bias", "known + bias"),), 10),
    (
        "lab3",
        "the sign of the Jacobians' transposes",
        (("bias - jacobians[0].T @ wrenches[0] -", "bias + jacobians[0].T @ wrenches[0] +"),),
        25,
    ),
    ("lab3", "no damping", (("- 600.0 * velocity\n", "\n"),), 50),
    ("lab3", "the moment's sign", (("np.cross(arm, force)", "np.cross(force, arm)"),), 30),
    ("lab4", "right and left swapped", (("1 if state < 2 else 0", "0 if state < 2 else 1"),), 90),
    ("lab4", "swing and stance swapped", (("1 if state < 2 else 0", "int(state) % 2"),), 30),
    (
        "lab4",
        "a foot that is not placed",
        (("angle + c_d * distance + c_v * velocity", "angle"),),
        30,
    ),
    ("lab4", "the swing leg's sign", (("-torso - swing", "-torso + swing"),), 30),
    ("lab5", "no samples", (("+ spread *", "+ 0.0 *"),), 40),
    (
        "lab5",
        "the joints alone cost",
        (("+ 3.0 * (foot**2).sum(axis=1) + 3.0 * trunk**2 + balance", ""),),
        40,
    ),
    ("lab5", "the best alone survives", (("* good // int(count)", "* 0"),), 30),
    ("lab5", "the best few survive", (("* good // int(count)", ""),), 50),
    ("lab5", "a path that is not traced", (("row[samples[-1]]", "samples[-1]"),), 40),
    (
        "lab6",
        "the dearest plans count",
        (("np.exp(-(costs - costs.min()) /", "np.exp(costs /"),),
        30,
    ),
    ("lab6", "no noise", (("plan + sigma * noise", "plan + 0.0 * noise"),), 30),
    ("lab6", "hanging costs least", (("lack = 1.0 + np", "lack = 1.0 - np"),), 25),
]


LONG = ("lab3", "lab5", "lab6")  # all but their solutions is for the night
NIGHTLY = {lab: pytest.param(lab, marks=pytest.mark.nightly) for lab in LONG}


@pytest.mark.parametrize("lab", LABS)
def test_a_solution_has_all_points(lab: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text(solution(lab))

    sheet = grade(lab, file)

    assert sheet.errors == ()
    assert sheet.points == sum(each.of for each in sheet.criteria) == 100
    assert sheet.state_hash.startswith(HASHES[lab])


@pytest.mark.parametrize("lab", [NIGHTLY.get(lab, lab) for lab in LABS])
def test_a_stub_has_few(lab: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_bytes(stub_of(lab))

    assert grade(lab, file).points <= 10


def _wrong() -> Iterator[object]:
    seen = {*LONG}  # of the others the first one is for each time
    for lab, what, changes, points in WRONG:
        marks = [pytest.mark.nightly] if lab in seen else []
        seen.add(lab)
        yield pytest.param(lab, changes, points, id=f"{lab}: {what}", marks=marks)


@pytest.mark.parametrize(("lab", "changes", "points"), list(_wrong()))
def test_what_is_wrong_costs_points(
    lab: str, changes: tuple[tuple[str, str], ...], points: int, tmp_path: Path
) -> None:
    file = tmp_path / "mine.py"
    file.write_text(solution(lab, *changes))

    sheet = grade(lab, file)

    assert sheet.points == points, [(each.what, each.measured) for each in sheet.criteria]


@pytest.mark.parametrize("lab", LABS)
def test_there_are_three_wrong_ones_of_each(lab: str) -> None:
    assert sum(of == lab for of, *_ in WRONG) >= 3
