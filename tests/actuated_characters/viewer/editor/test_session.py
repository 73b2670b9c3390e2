"""A timeline that is made: keys where the time is, poses by hand, copies, mirror and undo."""

from pathlib import Path

import numpy as np
import pytest

from actuated_characters.timeline import edits
from actuated_characters.timeline.document import Document
from actuated_characters.viewer.editor.session import Session
from msgs_config.errors import MotionError
from tests.support.physics import character

HUMANOID = character("humanoid")
LAYOUT = HUMANOID.layout
ELBOW, OTHER = LAYOUT.joint("right_elbow").start, LAYOUT.joint("left_elbow").start
TEMPLATE = "character: humanoid\n"


@pytest.fixture
def session(tmp_path: Path) -> Session:
    return Session(HUMANOID, Document(tmp_path / "a.yaml", TEMPLATE))


def bend(session: Session, angle: float) -> None:
    """Bend the right elbow by hand."""
    position = session.pose.position.copy()
    position[ELBOW] = angle
    session.take_pose(LAYOUT.configuration(position))


def key_at(session: Session, time: float, angle: float) -> None:
    session.playback.seek(time)
    bend(session, angle)
    session.set_key()


def test_a_pose_by_hand_is_seen_at_its_time_until_it_is_a_key(session: Session) -> None:
    session.playback.seek(1.0)
    bend(session, 1.2)
    assert (session.is_posed, session.key) == (True, None)
    session.playback.seek(2.0)
    assert session.pose.position[ELBOW] == 0.0
    session.playback.seek(1.0)

    session.set_key()

    assert (session.is_posed, session.key) == (False, 0)
    assert session.pose.position[ELBOW] == pytest.approx(1.2)
    assert list(session.poses[0]["pose"]) == list(LAYOUT.dof_names)


def test_a_key_may_have_what_moved_alone(session: Session) -> None:
    session.writes_all = False
    with pytest.raises(MotionError, match="no joint has moved"):
        session.set_key()

    key_at(session, 1.0, 1.2)
    key_at(session, 2.0, 0.4)

    assert [pose["pose"] for pose in session.poses] == [{"right_elbow": 1.2}, {"right_elbow": 0.4}]


def test_a_key_is_mirrored_copied_moved_and_deleted_and_all_is_undone(session: Session) -> None:
    key_at(session, 1.0, 1.2)
    session.mirror()
    assert session.pose.position[[ELBOW, OTHER]] == pytest.approx((0.0, 1.2))
    session.copy()
    session.playback.seek(2.0)
    session.paste()
    session.move_key(3.0)
    assert (session.time, session.key) == (3.0, 1)
    session.set_ease("rest")
    session.go_to_key(-1)
    assert session.time == 1.0
    session.delete_key()
    assert [pose["at"] for pose in session.poses] == [3.0]
    assert session.poses[0]["ease"] == "rest"

    while session.undo():
        pass

    assert session.document.file.read_text() == TEMPLATE
    assert session.poses == []
    assert session.redo() and session.poses[0]["at"] == 1.0


def test_rates_are_mirrored_and_copied_with_their_key(session: Session) -> None:
    given, image = {"right_elbow": 2.0}, {"left_elbow": 2.0}
    pose = {"right_elbow": 1.2}
    session.edit(edits.add_pose(0, 1.0, pose, velocity=given, acceleration=given))
    session.playback.seek(1.0)

    session.mirror()
    session.copy()
    session.playback.seek(2.0)
    session.paste()

    for name in ("velocity", "acceleration"):
        assert [pose[name] for pose in session.poses] == [image, image]


def test_between_keys_a_mirror_image_is_a_pose_by_hand(session: Session) -> None:
    key_at(session, 1.0, 1.2)
    session.playback.seek(1.5)

    session.mirror()

    assert session.is_posed and not session.document.can_redo
    assert session.pose.position[OTHER] == pytest.approx(1.2)


@pytest.mark.parametrize("act", ["delete_key", "paste"])
def test_what_is_not_there_is_said(session: Session, act: str) -> None:
    with pytest.raises(MotionError, match=r"no key at 0 s|nothing was copied"):
        getattr(session, act)()


def test_keys_of_a_file_can_be_gone_to_whatever_their_times(session: Session) -> None:
    for at in (0.12345, 1.0, 7.77):
        session.edit(edits.add_pose(0, at, {"right_elbow": at / 10.0}))

    found = []
    session.playback.seek(0.0)
    for _ in range(3):
        session.go_to_key(1)
        found.append((session.time, session.key))

    assert found == [(0.12345, 0), (1.0, 1), (7.77, 2)]
    assert session.playback.end == pytest.approx(10.0)
    assert (np.diff(session.playback.times) > 1e-3).all()


def test_the_time_line_is_as_long_as_the_file_says(session: Session) -> None:
    assert session.playback.end == pytest.approx(5.0)
    session.edit(edits.set_value("duration", 2.5))
    assert session.playback.end == pytest.approx(2.5)


def test_the_time_line_grows_by_whole_pages_and_is_never_shorter_again(session: Session) -> None:
    lengths = []
    for at in (0.5, 2.0, 4.0, 4.1, 7.0, 9.0, 13.0):
        session.edit(edits.add_pose(0, at, {"right_elbow": 0.1}))
        lengths.append(session.playback.end)
    while session.undo():
        lengths.append(session.playback.end)

    assert lengths[:7] == pytest.approx([5.0, 5.0, 5.0, 10.0, 10.0, 10.0, 15.0])
    assert lengths[7:] == pytest.approx([15.0] * 7)


def test_a_layer_that_is_added_is_the_one_that_keys_go_to(session: Session) -> None:
    key_at(session, 1.0, 1.2)
    session.add_layer("head")
    session.writes_all = False
    key_at(session, 2.0, 0.3)

    layers = session.document.content["keys"]
    assert [len(layer["poses"]) for layer in layers] == [1, 1]
    assert layers[1]["poses"][0]["pose"] == {"right_elbow": 0.3}
    session.undo()
    session.undo()
    assert session.layer == 0
