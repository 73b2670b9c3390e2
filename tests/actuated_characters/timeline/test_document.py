"""A timeline's document: any edits can be undone to the byte, and the file is always the newest."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from actuated_characters.timeline import content as timeline
from actuated_characters.timeline import edits
from actuated_characters.timeline.document import Document
from actuated_characters.timeline.edits import Edit
from msgs_config.errors import ActuatedCharactersError, MotionError

BY_HAND = """\
# a wave, by hand
character: humanoid
keys:
  - name: wave          # the right arm
    in: 0.25
    poses:
      - {at: 1, pose: {right_elbow: 1.20}, ease: rest}
      - {at: 1.5, pose: {right_elbow: 0.4}}
pushes: [{at: 2.0, link: chest, force: [0, 200, 0]}]
"""


def moved(track: str, number: int, at: float) -> Edit:
    """Another time for an event, as a drag on the time line gives it."""

    def edit(content: timeline.Content) -> timeline.Content:
        events = content.get(track, [])
        event = edits.event_at(events[number], at) if 0 <= number < len(events) else {}
        return edits.replace_event(track, number, event)(content)

    return edit


NUMBERS = st.floats(-10.0, 10.0)
TIMES = st.floats(-0.5, 20.0)
ROWS = st.integers(-1, 4)
NAMES = st.sampled_from(["right_elbow", "left_elbow", "1e3", "yes", "~", "Ärmel: #"])
VALUES: st.SearchStrategy[Any] = st.one_of(
    st.none(), NUMBERS, st.booleans(), NAMES, st.lists(NUMBERS, max_size=3)
)
POSES = st.dictionaries(NAMES, NUMBERS, max_size=3)
TRACKS = st.sampled_from(timeline.TRACKS)
EDITS: st.SearchStrategy[Edit] = st.one_of(
    st.builds(edits.add_layer, NAMES),
    st.builds(edits.delete_layer, ROWS),
    st.builds(edits.set_layer, ROWS, st.sampled_from(["in", "out"]), VALUES),
    st.builds(edits.add_pose, ROWS, TIMES, POSES, st.sampled_from([None, "rest", "smooth"])),
    st.builds(edits.move_pose, ROWS, ROWS, TIMES),
    st.builds(edits.copy_pose, ROWS, ROWS, TIMES),
    st.builds(edits.delete_pose, ROWS, ROWS),
    st.builds(edits.add_pose, ROWS, TIMES, POSES, st.none(), POSES),
    st.builds(edits.set_pose, ROWS, ROWS, POSES),
    st.builds(edits.set_pose, ROWS, ROWS, POSES, POSES),
    st.builds(edits.set_pose_value, ROWS, ROWS, NAMES, NUMBERS),
    st.builds(edits.set_ease, ROWS, ROWS, st.just("rest")),
    st.builds(
        lambda track, at, until: edits.add_event(track, {"at": at, "until": until}),
        TRACKS, TIMES, TIMES,
    ),
    st.builds(moved, TRACKS, ROWS, TIMES),
    st.builds(edits.delete_event, TRACKS, ROWS),
    st.builds(edits.set_event, TRACKS, ROWS, st.sampled_from(["link", "force"]), VALUES),
    st.builds(edits.set_value, st.sampled_from(["duration", "run"]), NUMBERS),
)  # fmt: skip
UNDO, REDO = "undo", "redo"


@pytest.mark.parametrize("text", [BY_HAND, BY_HAND.replace("\n", "\r\n"), "", "keys:\n"])
@settings(max_examples=40, deadline=None)
@given(st.lists(st.one_of(EDITS, st.sampled_from([UNDO, REDO])), max_size=12))
def test_undoing_everything_gives_the_file_of_before(
    tmp_path_factory: pytest.TempPathFactory, text: str, done: list[Any]
) -> None:
    file = tmp_path_factory.mktemp("edited") / "a.yaml"
    file.write_bytes(text.encode())
    document = Document(file)

    for each in done:
        try:
            if each == UNDO:
                document.undo()
            elif each == REDO:
                document.redo()
            else:
                document.apply(each)
        except MotionError:
            continue  # such an edit cannot be made here, and alters nothing
        assert file.read_bytes() == document.text.encode()
        assert timeline.parse(file, document.text) == document.content
        assert_in_order(document.content)
        assert_no_rest_with_a_velocity(document.content)
        assert Document(file).content == document.content  # as after a kill
    newest = document.text
    undone = 0
    while document.undo():
        undone += 1
    assert file.read_bytes() == text.encode()
    for _ in range(undone):
        assert document.redo()
    assert document.text == newest


def assert_in_order(content: timeline.Content) -> None:
    lists = [layer["poses"] for layer in content.get("keys") or []]
    lists += [content.get(track, []) for track in timeline.TRACKS]
    for each in lists:
        times = [item["at"] for item in each]
        assert times == sorted(times)


def assert_no_rest_with_a_velocity(content: timeline.Content) -> None:
    for layer in content.get("keys") or []:
        for pose in layer["poses"]:
            is_moving = "velocity" in pose or "acceleration" in pose
            assert not is_moving or pose.get("ease") != "rest"


def test_a_velocity_stays_with_its_pose_until_it_is_to_rest_there(tmp_path: Path) -> None:
    document = Document(tmp_path / "a.yaml", "character: humanoid\n")
    elbow = {"right_elbow": 0.4}
    for edit in (
        edits.add_pose(0, 1.0, elbow, None, {"right_elbow": -2.0}, {"right_elbow": 9.0}),
        edits.copy_pose(0, 0, 2.0),
        edits.move_pose(0, 1, 3.0),
        edits.add_pose(0, 3.0, {"right_elbow": 0.5}),
        edits.set_pose_value(0, 1, "right_elbow", 0.6),
        edits.set_ease(0, 0, "rest"),
    ):
        assert document.apply(edit)

    first, second = document.content["keys"][0]["poses"]
    assert first == {"at": 1.0, "pose": elbow, "ease": "rest"}
    rates = {"velocity": {"right_elbow": -2.0}, "acceleration": {"right_elbow": 9.0}}
    assert second == {"at": 3.0, "pose": {"right_elbow": 0.6}, **rates}
    assert document.apply(edits.set_pose(0, 1, elbow, velocity={}))
    assert "velocity" not in document.content["keys"][0]["poses"][1]
    assert "acceleration" in document.content["keys"][0]["poses"][1]


def test_a_new_file_is_there_from_the_first_edit_on(tmp_path: Path) -> None:
    file = tmp_path / "new.yaml"
    document = Document(file, "character: humanoid\n")
    assert not file.exists()

    assert document.apply(edits.add_pose(0, 1.0, {"right_elbow": 1.23456789}))

    assert file.read_text() == (
        "character: humanoid\n"
        "keys:\n"
        "- name: body\n"
        "  in: 0.3\n"
        "  out: never\n"
        "  poses:\n"
        "  - at: 1.0\n"
        "    pose: {right_elbow: 1.234568}\n"
    )
    document.undo()
    assert file.read_text() == "character: humanoid\n"


def test_what_changes_nothing_is_no_step(tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    file.write_text(BY_HAND)
    document = Document(file)

    assert not document.apply(edits.set_event("pushes", 0, "link", "chest"))

    assert not document.can_undo
    assert file.read_text() == BY_HAND


def test_poses_and_events_are_added_moved_copied_and_deleted(tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    file.write_text(BY_HAND)
    document = Document(file)

    for edit in (
        edits.copy_pose(0, 0, 3.0),
        edits.move_pose(0, 1, 0.5),
        edits.add_pose(0, 3.0, {"left_elbow": 0.7}),
        edits.delete_pose(0, 1),
        edits.add_event("limp", {"at": 5.0, "until": 6.0}),
        moved("limp", 0, 4.0),
        edits.add_event("pushes", {"at": 1.0, "link": "chest", "force": [0, 200, 0]}),
        edits.set_event("pushes", 1, "link", "neck"),
    ):
        assert document.apply(edit)

    assert document.content["keys"][0]["poses"] == [
        {"at": 0.5, "pose": {"right_elbow": 0.4}},
        {"at": 3.0, "pose": {"left_elbow": 0.7}, "ease": "rest"},
    ]
    assert document.content["limp"] == [{"at": 4.0, "until": 5.0}]
    assert [each["link"] for each in document.content["pushes"]] == ["chest", "neck"]


@pytest.mark.parametrize(
    ("edit", "reason"),
    [
        (edits.move_pose(0, 0, 1.5), "there is a pose at 1.5 s already"),
        (edits.move_pose(0, 7, 3.0), "layer 0 has no pose 7; there are 2"),
        (edits.add_pose(3, 1.0, {}), "keys has no item 3; there are 1"),
        (edits.add_pose(0, -1.0, {}), "at is -1.0; it must be a time in s, 0 or more"),
        (edits.add_event("shoves", {"at": 1.0}), "unknown track 'shoves'.*pushes"),
    ],
)
def test_an_edit_that_cannot_be_made_says_why(tmp_path: Path, edit: Edit, reason: str) -> None:
    file = tmp_path / "a.yaml"
    file.write_text(BY_HAND)
    document = Document(file)

    with pytest.raises(MotionError, match=reason):
        document.apply(edit)

    assert file.read_text() == BY_HAND


def test_what_another_program_has_written_is_not_lost(tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    file.write_text(BY_HAND)
    document = Document(file)
    document.apply(edits.delete_event("pushes", 0))
    by_hand = BY_HAND.replace("1.20", "1.25")
    file.write_text(by_hand)

    with pytest.raises(MotionError, match="was changed by another program"):
        document.apply(edits.set_value("duration", 3.0))
    assert file.read_text() == by_hand
    assert document.read_again()

    assert document.apply(edits.set_value("duration", 3.0))
    assert document.content["keys"][0]["poses"][0]["pose"]["right_elbow"] == 1.25
    while document.undo():
        pass
    assert file.read_text() == BY_HAND


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("keys: {at: 1}\n", "a.yaml: keys must be a list"),
        ("keys: [{name: a}]\n", "a.yaml: keys 1: poses must be a list"),
        ("keys: [{poses: [{at: soon, pose: {}}]}]\n", "poses 1: at must be a time in s"),
        ("keys: [{poses: [{at: 1}]}]\n", "poses 1: pose must be a mapping"),
        ("pushes: [3]\n", "a.yaml: pushes 1 must be a mapping"),
        ("push: []\n", "unknown key 'push'; did you mean 'pushes'"),
        ("- 1\n", "must hold a mapping"),
        ("keys: [\n", "not valid YAML"),
    ],
)
def test_a_file_that_is_no_timeline_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    file = tmp_path / "a.yaml"
    file.write_text(text)

    with pytest.raises(ActuatedCharactersError, match=reason):
        Document(file)
