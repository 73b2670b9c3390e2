"""Takes: what follows an edit is simulated, as in a whole run of the edited file."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from actuated_characters.bags.recording import Recording, read_recording
from actuated_characters.bags.whole import read_whole
from actuated_characters.runs.planned.timeline import plan_timeline
from actuated_characters.timeline.takes import Take, takes_of
from actuated_characters.timeline.taking import PlannedTake, make_take, plan_take
from msgs_config.errors import ActuatedCharactersError
from tests.support.runs import run_plan_here

RATE = 240
ELBOW = {"poses": [{"at": 1.5, "pose": {"left_elbow": 1.0}}]}
CONTENT: dict[str, Any] = {
    "duration": 2.0,
    "run": {"planner": "none"},
    "clips": [{"at": 0.0, "clip": "walk"}],
    "keys": [ELBOW],
    "pushes": [{"at": 0.3, "link": "chest", "force": [40, 0, 0]}],
    "strengths": [{"at": 1.2, "until": 1.9, "joints": ["neck"], "strength": 0.5}],
}
HELD = {"at": 0.4, "until": 1.7, "link": "right_wrist", "point": "here", "force": 60}


def written(directory: Path, **changes: Any) -> Path:
    file = directory / "moves.yaml"
    file.write_text(yaml.safe_dump({**CONTENT, **changes}), encoding="utf-8")
    return file


def planned_take(file: Path, parent: Take | None) -> PlannedTake:
    return plan_take(str(file), takes_of(str(file)), parent)


def whole_run(file: Path, directory: Path) -> Recording:
    """The run of a file from its beginning."""
    run = plan_timeline(str(file), {"keyframe_period": 0.25}, {})
    run_plan_here(run.plan, directory, run.inputs)
    return read_recording(directory)


def assert_same_end(take: Take, whole: Recording) -> None:
    """A take's states are the last ones of a whole run, to the bit."""
    own = read_recording(take.directory)
    begin = round(take.begin * RATE)
    assert len(own.position) == len(whole.position) - begin
    np.testing.assert_array_equal(own.stamps_ns, whole.stamps_ns[begin:])
    for name in ("position", "velocity", "effort"):
        np.testing.assert_array_equal(getattr(own, name), getattr(whole, name)[begin:])
    # nobody waits for the answer to the last state
    np.testing.assert_array_equal(own.reference_position[:-1], whole.reference_position[begin:-1])


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Take:
    directory = tmp_path_factory.mktemp("takes")
    return make_take(planned_take(written(directory), None))


def edited(first: Take, **changes: Any) -> Path:
    """The file of the first take, changed."""
    return written(first.directory.parent.parent, **changes)


def night(*case: object) -> Any:
    """A case that is more of the same as another one."""
    return pytest.param(*case, marks=pytest.mark.nightly)


def later(layer: dict[str, Any]) -> dict[str, Any]:
    poses = [*layer["poses"], {"at": 1.8, "pose": {"left_elbow": 0.2}}]
    return {**layer, "poses": poses}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "since"),
    [
        ({"keys": [later(ELBOW)]}, (1.48, 1.5)),  # it does not come to rest there any more
        ({"keys": []}, (1.1, 1.2)),
        ({"pushes": [*CONTENT["pushes"], {"at": 1.6, "link": "root", "force": [0, 50, 0]}]}, 1.6),
        night({"strengths": []}, 1.2),
        ({"limp": [{"at": 1.5, "until": 1.7}]}, 1.5),
        night({"pins": [{**HELD, "at": 1.6}]}, 1.6),
        ({"throws": [{"at": 1.5, "mass": 1, "speed": 8, "target": "chest"}]}, (1.2, 1.5)),
        night({"duration": 2.5}, 2.0 - 1 / RATE),
        ({"duration": 1.5}, 1.5 - 1 / RATE),
    ],
    ids=[
        *("a pose", "no layer", "a push", "no weakness", "limp", "a pin", "a ball", "longer"),
        "shorter",
    ],
)
def test_a_take_is_the_end_of_a_whole_run_of_the_edited_file(
    first: Take, tmp_path: Path, changes: dict[str, Any], since: float | tuple[float, float]
) -> None:
    file = edited(first, **changes)
    planned = planned_take(file, first)

    take = make_take(planned)

    assert take.parent == first.name
    if isinstance(since, tuple):
        assert since[0] <= take.since <= since[1]
    else:
        assert take.since == pytest.approx(since)
    assert take.begin >= take.since - 0.5 - 1 / RATE
    assert_same_end(take, whole_run(file, tmp_path / "whole"))


@pytest.mark.slow
def test_a_take_of_a_take_goes_on_from_either(first: Take, tmp_path: Path) -> None:
    strengths = [{"at": 1.7, "until": 1.95, "joints": ["neck"], "strength": 0.2}]
    second = make_take(planned_take(edited(first, strengths=strengths), first))

    late = edited(first, strengths=[{**strengths[0], "joints": ["neck", "right_elbow"]}])
    third = make_take(planned_take(late, second))
    assert_same_end(third, whole_run(late, tmp_path / "late"))
    early = edited(first, pushes=[])
    fourth = make_take(planned_take(early, third))
    assert_same_end(fourth, whole_run(early, tmp_path / "early"))

    # with its past, each is the whole run
    for take, name in ((third, "late"), (fourth, "early")):
        (own,), whole = read_whole(take.directory), read_recording(tmp_path / name)
        for field in ("stamps_ns", "position", "velocity", "effort"):
            np.testing.assert_array_equal(getattr(own, field), getattr(whole, field))
        assert len(own.applied_wrench) == len(own.effort) == len(whole.effort)
    takes = takes_of(str(early))
    assert [each.name for each in takes.line(fourth)][-3:] == [
        second.name,
        third.name,
        fourth.name,
    ]
    assert (third.begin, fourth.begin) == (1.5, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pins", "since"),
    [
        ([{**HELD, "until": 1.5}], 1.5),  # let go sooner
        night([{**HELD, "until": 1.8}], 1.7),
        night([HELD, {**HELD, "at": 1.7, "until": 1.9, "force": 20}], 1.7),
        ([HELD, {**HELD, "at": 1.2, "link": "left_wrist"}], 1.2),
        night([], 0.4),
    ],
    ids=["sooner", "later", "another force", "another hand", "none"],
)
def test_a_take_of_other_pins_is_the_end_of_a_whole_run(
    tmp_path: Path, pins: list[dict[str, Any]], since: float
) -> None:
    first = make_take(planned_take(written(tmp_path, pins=[HELD]), None))
    file = written(tmp_path, pins=pins)

    take = make_take(planned_take(file, first))

    assert take.since == pytest.approx(since)
    assert take.begin >= since - 0.5 - 1 / RATE
    assert_same_end(take, whole_run(file, tmp_path / "whole"))
    (own,), whole = read_whole(take.directory), read_recording(tmp_path / "whole")
    rows = [[each and each.rows for each in one.pins] for one in (own, whole)]
    never = [None] * len(own.stamps_ns)
    assert (rows[0] or never) == (rows[1] or never)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("behaviours", "since"),
    [
        night([{"at": 0.4, "until": 1.5, "do": "brace"}], 1.5),
        night([{"at": 0.4, "until": 1.9, "do": "brace"}], 1.7),
        ([{"at": 0.4, "until": 1.2, "do": "brace"}, {"at": 1.3, "do": "react"}], 1.2),
        night([{"at": 1.9, "do": "react"}], 0.4),
    ],
    ids=["sooner", "later", "another one", "none"],
)
def test_a_take_of_other_behaviours_is_the_end_of_a_whole_run(
    tmp_path: Path, behaviours: list[dict[str, Any]], since: float
) -> None:
    braced = [{"at": 0.4, "until": 1.7, "do": "brace"}]
    first = make_take(planned_take(written(tmp_path, behaviours=braced), None))
    file = written(tmp_path, behaviours=behaviours)

    take = make_take(planned_take(file, first))

    assert take.since == pytest.approx(since)
    assert take.begin >= since - 0.5 - 1 / RATE
    assert_same_end(take, whole_run(file, tmp_path / "whole"))


def test_nothing_is_simulated_where_nothing_has_changed(first: Take) -> None:
    planned = planned_take(edited(first), first)

    assert planned.is_as_before and planned.fork is None
    assert planned.since == first.until


@pytest.mark.parametrize(
    "changes",
    [{"set": {"sim_node.friction": 0.5}}, {"run": {"planner": "none", "behaviour": "reactive"}}],
)
def test_other_parameters_are_simulated_from_the_beginning(
    first: Take, changes: dict[str, Any]
) -> None:
    planned = planned_take(edited(first, **changes), first)

    assert (planned.parent, planned.fork, planned.begin) == (None, None, 0.0)


@pytest.mark.nightly
def test_a_planned_take_is_the_end_of_a_planned_run(tmp_path: Path) -> None:
    planner = {"run": {"planner": "predictive"}, "clips": [], "duration": 2.5}
    first = make_take(planned_take(written(tmp_path, **planner), None))
    poses = [{"at": 2.2, "pose": {"left_elbow": 0.7}}]
    file = written(tmp_path, **planner, keys=[ELBOW, {"poses": poses}])

    take = make_take(planned_take(file, first))

    # its change is foreseen by 0.8 s, and 2 plans
    assert take.since == pytest.approx(1.9 - 0.8 - 0.1, abs=0.05)
    assert take.begin >= take.since - 0.5
    assert_same_end(take, whole_run(file, tmp_path / "whole"))


def test_a_clip_beside_the_file_is_found_by_the_take(tmp_path: Path, first: Take) -> None:
    del first
    import pybullet_data

    clip = Path(pybullet_data.getDataPath()) / "data/motions/humanoid3d_walk.txt"
    (tmp_path / "own.txt").write_text(clip.read_text("utf-8"), encoding="utf-8")
    file = written(
        tmp_path, clips=[{"at": 0.0, "clip": "own.txt"}], duration=0.2, strengths=[], pushes=[]
    )

    take = make_take(planned_take(file, None))

    again = planned_take(file, take)
    assert again.is_as_before


def test_incomplete_takes_are_none_and_numbers_are_free(tmp_path: Path) -> None:
    takes = takes_of(str(tmp_path / "moves.yaml"))
    assert takes.all() == []
    folders = [takes.free_directory() for _ in range(3)]
    assert [folder.name for folder in folders] == ["1", "2", "3"]
    Take(folders[1], "1", 0.5, 0.7, 2.0, "louder").write()
    (folders[2] / "take.json").write_text("{", encoding="utf-8")

    (take,) = takes.all()
    assert take == Take(folders[1], "1", 0.5, 0.7, 2.0, "louder")
    assert takes.line(take) == [take]
    with pytest.raises(ActuatedCharactersError, match=r"'7'.*2"):
        takes.find("7")
