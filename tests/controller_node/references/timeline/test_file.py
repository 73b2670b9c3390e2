"""Files of timelines: what is in them, and what is refused with one line."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from controller_node.references.timeline.description import Ease
from controller_node.references.timeline.file import read_timeline
from msgs_config.errors import ActuatedCharactersError, MotionError

POSE = {"at": 1.0, "pose": {"right_elbow": 0.5}}
WHOLE: dict[str, Any] = {
    "character": "humanoid",
    "duration": 8,
    "run": {"planner": "predictive", "behaviour": "active_ragdoll"},
    "set": {"sim_node.friction": 0.9, "controller_node.gain_scale.p": 1.1},
    "keys": [
        {
            "name": "wave",
            "in": 0.1,
            "out": "never",
            "poses": [
                {**POSE, "velocity": {"right_elbow": -1.5}, "acceleration": {"neck_x": 2}},
                {**POSE, "at": 2, "ease": "rest"},
            ],
        }
    ],
    "clips": [
        {"at": 5, "clip": "kick", "to": 1.0, "place": [1, 2], "heading": 0.5, "blend": 0},
        {"at": 2, "clip": "walk", "from": 0.1, "place": "here", "heading": "here"},
    ],
    "steering": [
        {"at": 1, "until": 2, "velocity": [0.5, 0, 0.1]},
        {"at": 2, "until": 3, "velocity": [1, 0, 0], "blend": 0.5},
    ],
    "reach": [{"at": 1, "until": 2, "link": "right_wrist", "point": [0.3, -0.2, 1.0]}],
    "look": [{"at": 1, "until": 2, "point": [2, 0, 1], "in": 0.2, "out": 0.4}],
    "limp": [{"at": 3, "until": 4}],
    "strengths": [{"at": 3, "until": 4, "joints": ["neck"], "strength": 0.5}],
    "pushes": [{"at": 1, "link": "chest", "force": [0, 100, 0], "for": 0.2}],
    "throws": [{"at": 2, "mass": 1, "speed": 5, "target": "chest", "from": "left"}],
}


def written(directory: Path, content: object) -> str:
    path = directory / "moves.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return str(path)


def test_each_key_is_read(tmp_path: Path) -> None:
    timeline = read_timeline(written(tmp_path, WHOLE))

    assert (timeline.character, timeline.duration) == ("humanoid", 8.0)
    assert timeline.run == WHOLE["run"]
    assert timeline.settings == {
        "sim_node": {"friction": 0.9},
        "controller_node": {"gain_scale.p": 1.1},
    }
    (layer,) = timeline.layers
    assert (layer.come, layer.go) == (0.1, None)
    assert [pose.at for pose in layer.poses] == [1.0, 2.0]
    assert [pose.ease for pose in layer.poses] == [Ease.SMOOTH, Ease.REST]
    assert [pose.velocity for pose in layer.poses] == [{"right_elbow": -1.5}, {}]
    assert [pose.acceleration for pose in layer.poses] == [{"neck_x": 2.0}, {}]
    walk, kick = timeline.clips  # by their times
    assert (walk.clip, walk.begin, walk.end, walk.blend) == ("walk", 0.1, None, 0.3)
    assert (walk.position, walk.heading) == (None, None)
    assert (kick.end, kick.position, kick.heading, kick.blend) == (1.0, (1.0, 2.0), 0.5, 0.0)
    assert [each.velocity for each in timeline.steering] == [(0.5, 0.0, 0.1), (1.0, 0.0, 0.0)]
    (reach,), (look,) = timeline.reaches, timeline.looks
    assert (reach.link, reach.point) == ("right_wrist", (0.3, -0.2, 1.0))
    assert (look.link, look.come, look.go) == ("", 0.2, 0.4)
    limp, weak = timeline.strengths
    assert (limp.strength, limp.joints) == (0.0, ())
    assert (weak.strength, weak.joints, weak.at, weak.until) == (0.5, ("neck",), 3.0, 4.0)
    assert (timeline.pushes[0].force, timeline.pushes[0].duration) == ((0.0, 100.0, 0.0), 0.2)
    assert timeline.throws[0].request == WHOLE["throws"][0]


def test_an_empty_timeline_is_one(tmp_path: Path) -> None:
    timeline = read_timeline(written(tmp_path, {}))

    assert timeline.duration is None
    assert not (timeline.layers or timeline.clips or timeline.pushes)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"key": []}, "unknown key 'key'.*keys"),
        ({"keys": 5}, "keys is 5; it must be a list"),
        ({"keys": [5]}, "keys 1 is 5; it must be a mapping with 'at'"),
        ({"keys": [{}]}, "keys 1: poses is missing; it must be a list of one pose or more"),
        ({"keys": [{"poses": [{"at": 1}]}]}, "keys 1: poses 1: pose is empty"),
        ({"keys": [{"poses": [{"pose": {"neck": 1}}]}]}, "keys 1: poses 1: at is None; it must be"),
        ({"keys": [{"poses": [POSE, POSE]}]}, "poses 2: at is 1; it must be later than the 1 s"),
        (
            {"keys": [{"poses": [{**POSE, "ease": "linear"}]}]},
            "poses 1: ease is 'linear'; it must be 'smooth' or 'rest'",
        ),
        (
            {"keys": [{"poses": [{"at": 1, "pose": {"neck": "a"}}]}]},
            "poses 1: pose.neck is 'a'; it must be a finite number",
        ),
        (
            {"keys": [{"poses": [{**POSE, "velocity": {"right_elbow": "a"}}]}]},
            "poses 1: velocity.right_elbow is 'a'; it must be a finite number",
        ),
        (
            {"keys": [{"poses": [{**POSE, "velocity": 3}]}]},
            "poses 1: velocity is 3; it must be a mapping",
        ),
        (
            {"keys": [{"poses": [{**POSE, "ease": "rest", "velocity": {"right_elbow": 1}}]}]},
            "poses 1: a pose has a velocity or 'ease: rest', not both; remove one",
        ),
        (
            {"keys": [{"poses": [{**POSE, "ease": "rest", "acceleration": {"neck_x": 1}}]}]},
            "poses 1: a pose has an acceleration or 'ease: rest', not both; remove one",
        ),
        ({"keys": [{"out": "ever", "poses": [POSE]}]}, "keys 1: out is 'ever'; it must be"),
        ({"keys": [{"in": -1, "poses": [POSE]}]}, "keys 1: in is -1; it must be"),
        ({"clips": [{"at": 1}]}, "clips 1: clip is None; it must be a text"),
        ({"clips": [{"at": -1, "clip": "walk"}]}, "clips 1: at is -1; it must be"),
        (
            {"clips": [{"at": 1, "clip": "walk", "from": 2, "to": 1}]},
            "clips 1: to is 1.0; it must be later than 'from', 2 s",
        ),
        ({"clips": [{"at": 1, "clip": "walk", "place": 3}]}, "clips 1: place is 3; it must be"),
        ({"clips": [{"at": 1, "clip": "a"}] * 2}, "clips 2: at is 1; it must be later than the 1"),
        ({"steering": [{"at": 2, "until": 2}]}, "steering 1: until is 2.0; it must be later than"),
        (
            {
                "steering": [
                    {"at": 1, "until": 3, "velocity": [0, 0, 0]},
                    {"at": 2, "until": 4, "velocity": [0, 0, 0]},
                ]
            },
            "steering 2: at is 2; it must be 3 s or later, when the velocity before is over",
        ),
        ({"strengths": [{"at": 1, "until": 2}]}, "strengths 1: strength is None; it must be"),
        (
            {"strengths": [{"at": 1, "until": 2, "strength": 2}]},
            "strengths 1: strength is 2; it must be a finite number from 0 to 1",
        ),
        ({"pushes": [{"at": 1, "link": "a", "force": [1, 2]}]}, "pushes 1: force is a list; it"),
        ({"throws": [{"at": 1, "wieght": 2}]}, "throws 1: unknown key 'wieght'"),
        ({"duration": 0}, "duration is 0; it must be"),
        ({"run": {"machine": "walk"}}, "unknown key 'run.machine'"),
        (
            {"set": {"law": "pd"}},
            "set: 'law' is no parameter of a node; it must be controller_node",
        ),
    ],
)
def test_what_is_wrong_is_named_in_a_line(
    tmp_path: Path, change: dict[str, Any], sentence: str
) -> None:
    path = written(tmp_path, change)

    with pytest.raises(MotionError, match=sentence) as caught:
        read_timeline(path)

    assert str(caught.value).startswith(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["", "moves.bvh", "missing.yaml", "unheard_of"])
def test_another_file_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ActuatedCharactersError):
        read_timeline(str(tmp_path / name) if name else name)
