"""A plan that is kept in a clip's file, and played from there."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import make_plan
from controller_node.references.files.reconstructed import PLAN, ReconstructedClip
from controller_node.references.offsets import Offsets, RecordedPlan
from msgs_config.clips.reading import clip_path
from msgs_config.errors import ClipError, ConfigurationError
from tests.support.physics import character

HUMANOID = character("humanoid")
DOFS = HUMANOID.layout.dof_names[6:]
KNOTS, PERIOD = 36, 12  # ticks
ROWS = np.random.default_rng(2).normal(size=(4, len(DOFS)))


def some_plan() -> RecordedPlan:
    """Two plans over 60 ticks, from tick 1 on, as with a delay of one."""
    first = Offsets(KNOTS, 0, ROWS).during(1, 39)
    second = Offsets(KNOTS, 0, -ROWS).during(40, 20)
    return RecordedPlan(240, 60, ((1, first), (40, second)))


def written(path: Path, plan: RecordedPlan) -> Path:
    """A file with a plan and nothing else but its clip."""
    clip = json.loads(clip_path(HUMANOID, "walk").read_text())
    path.write_text(json.dumps({**clip, PLAN: plan.content(DOFS)}))
    return path


def test_offsets_are_linear_between_knots() -> None:
    offsets = Offsets(KNOTS, 0, ROWS)

    assert offsets.at(0).tobytes() == ROWS[0].tobytes()
    assert offsets.at(KNOTS).tobytes() == ROWS[1].tobytes()
    np.testing.assert_allclose(offsets.at(45), 0.75 * ROWS[1] + 0.25 * ROWS[2], atol=1e-12)


@pytest.mark.parametrize(("first", "ticks", "rows"), [(0, 12, 2), (36, 36, 2), (30, 12, 3)])
def test_of_offsets_what_a_part_needs_is_kept_to_the_bit(first: int, ticks: int, rows: int) -> None:
    whole = Offsets(KNOTS, 0, ROWS)

    part = whole.during(first, ticks)

    assert len(part.rows) == rows
    for tick in range(first, first + ticks):
        assert part.at(tick).tobytes() == whole.at(tick).tobytes()


def test_a_plan_is_nothing_before_it_begins_and_when_it_is_over() -> None:
    plan = some_plan()

    assert not plan.at(0).any() and not plan.at(60).any() and not plan.at(10**6).any()
    assert plan.at(1).any() and plan.at(59).any()
    assert plan.at(40).tobytes() == (-Offsets(KNOTS, 0, ROWS).at(40)).tobytes()


def test_a_file_gives_back_the_same_doubles(tmp_path: Path) -> None:
    plan = some_plan()

    found = ReconstructedClip(HUMANOID, str(written(tmp_path / "walk.json", plan))).plan

    assert found is not None
    assert (found.rate_hz, found.ticks) == (240, 60)
    for tick in range(70):
        assert found.at(tick).tobytes() == plan.at(tick).tobytes()


def test_the_offsets_are_added_to_the_tracking_errors(tmp_path: Path) -> None:
    # Oracle: an offset of a hinge that is constant is that joint's reference, moved.
    knee = DOFS.index("right_knee")
    rows = np.zeros((2, len(DOFS)))
    rows[:, knee] = -0.4  # rad
    offset = Offsets(1000, 0, rows)
    file = written(tmp_path / "walk.json", RecordedPlan(240, 48, ((0, offset),)))

    bent, straight = (
        [
            tick.following.position[6 + knee]
            for tick in ticks_in_process(
                make_plan("humanoid", 0.2, {"reference": "clip", "clip": clip}, {}, given)
            )
        ][-1]
        for clip, given in (
            (str(file), {"planner": "recorded"}),
            ("walk", {"root_assistance": False}),
        )
    )

    assert -0.5 < bent - straight < -0.3


@pytest.mark.parametrize("clip", ["walk", "clip.json"])
def test_a_clip_without_a_plan_has_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, clip: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "clip.json").write_text('{"Loop": "none", "Frames": [[1], [1]]}')

    assert ReconstructedClip(HUMANOID, clip).plan is None


def without(key: str) -> Callable[[dict[str, Any]], object]:
    return lambda plan: plan.pop(key)


def setting(key: str, value: object) -> Callable[[dict[str, Any]], object]:
    return lambda plan: plan.update({key: value})


def in_part(number: int, key: str, value: object) -> Callable[[dict[str, Any]], object]:
    return lambda plan: plan["parts"][number].update({key: value})


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (without("dofs"), "must have 'rate', 'ticks' and 'knot_ticks', 'dofs', and 'parts'"),
        (without("parts"), "must have 'rate'"),
        (setting("rate", "fast"), "must have 'rate'"),
        (setting("parts", [7]), "must have 'rate'"),
        (setting("parts", []), "must be 1 or more"),
        (setting("knot_ticks", 0), "must be 1 or more"),
        (setting("dofs", list(DOFS[::-1])), "in its order"),
        (setting("ticks", 40), "the parts' ticks must rise"),
        (in_part(0, "tick", -1), "the parts' ticks must rise"),
        (in_part(1, "tick", 0), "the parts' ticks must rise"),
        (in_part(1, "knot", 0), "from tick 40 on offsets are"),
        (in_part(0, "offsets", [[0.0] * len(DOFS)]), r"must be \(3, 28\) from knot 0"),
        (in_part(0, "offsets", [[float("nan")] * len(DOFS)] * 3), "not finite"),
        (in_part(0, "offsets", [[1e9] * len(DOFS)] * 3), "not finite, or over 1000"),
    ],
)
def test_what_is_wrong_with_a_file_is_said(
    tmp_path: Path, change: Callable[[dict[str, Any]], object], reason: str
) -> None:
    path = written(tmp_path / "walk.json", some_plan())
    content = json.loads(path.read_text())
    change(content[PLAN])
    path.write_text(json.dumps(content))

    with pytest.raises(ClipError, match=reason) as error:
        _ = ReconstructedClip(HUMANOID, str(path)).plan

    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("text", ["", "[", "[1, 2]", "7"])
def test_a_file_that_is_no_clip_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "walk.json"
    path.write_text(text)

    with pytest.raises(ClipError, match="not a motion clip"):
        ReconstructedClip(HUMANOID, str(path))


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"reference": "clip", "clip": "walk"}, "the clip 'walk' has none"),
        ({"reference": "hold"}, "has none"),
        ({"rate": 480}, "'rate' is 480; the plan in .* is for 240"),
        ({"behaviour": "reactive"}, "for the behaviour tracking"),
        ({"law": "pd"}, "'law' is pd"),
    ],
)
def test_what_cannot_be_played_is_said(
    tmp_path: Path, given: dict[str, object], reason: str
) -> None:
    file = written(tmp_path / "walk.json", some_plan())
    motion = {} if "reference" in given else {"reference": "clip", "clip": str(file)}

    with pytest.raises(ConfigurationError, match=reason):
        plan = make_plan("humanoid", 0.1, motion, {}, {"planner": "recorded", **given})
        next(iter(ticks_in_process(plan)))
