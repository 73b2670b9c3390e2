"""The layouts of RViz and Foxglove that ship name topics, fields and frames that there are."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from msgs_config.character.loading import load_character
from msgs_config.frame_names import BASE_FRAME
from msgs_config.messages import topics
from msgs_config.messages.topic import Topic
from sim_node.frames import FrameNames

CONFIG = Path(__file__).parents[2] / "config"
DISPLAYS = {  # the message that each class of RViz' displays subscribes to
    "RobotModel": "String",
    "Odometry": "Odometry",
    "MarkerArray": "MarkerArray",
    "Wrench": "WrenchStamped",
}
WITHOUT_TOPIC = {"Grid", "TF"}


def offered() -> dict[str, Topic]:
    """The topics that the humanoid's simulator offers, by their names in the layouts."""
    found = [each for each in vars(topics).values() if isinstance(each, Topic)]
    links = load_character("humanoid").links
    found += [topics.contact_wrench(link.name) for link in links if link.collision_shapes]
    return {f"/{topic.name.lstrip('/')}": topic for topic in found}


def rviz() -> dict[str, Any]:
    content: dict[str, Any] = yaml.safe_load((CONFIG / "actuated_characters.rviz").read_text())
    return content["Visualization Manager"]


@pytest.mark.parametrize("display", rviz()["Displays"], ids=lambda display: display["Name"])
def test_a_display_of_rviz_subscribes_to_what_is_published_as_it_is(display: Any) -> None:
    kind = display["Class"].removeprefix("rviz_default_plugins/")
    topic = display.get("Topic", display.get("Description Topic"))
    if topic is None:
        assert kind in WITHOUT_TOPIC
        return

    found = offered()[topic["Value"]]

    assert found.message_type.__name__ == DISPLAYS[kind]
    latched = found.qos.durability.name == "TRANSIENT_LOCAL"
    assert topic["Durability Policy"] == ("Transient Local" if latched else "Volatile")
    assert topic["Reliability Policy"] == "Reliable"


def test_rviz_and_foxglove_look_at_frames_that_there_are() -> None:
    layout = json.loads((CONFIG / "foxglove.json").read_text())["configById"]["3D!model"]

    assert rviz()["Global Options"]["Fixed Frame"] == FrameNames.odom
    assert rviz()["Views"]["Current"]["Target Frame"] == BASE_FRAME
    assert layout["followTf"] == BASE_FRAME
    assert layout["layers"]["grid"]["frameId"] == FrameNames.odom


def test_every_panel_of_foxglove_is_in_its_layout_once() -> None:
    layout = json.loads((CONFIG / "foxglove.json").read_text())

    def panels(part: Any) -> Iterator[str]:
        if isinstance(part, str):
            yield part
        else:
            yield from panels(part["first"])
            yield from panels(part["second"])

    assert sorted(panels(layout["layout"])) == sorted(layout["configById"])


def test_foxglove_shows_topics_and_plots_fields_that_there_are() -> None:
    panels = json.loads((CONFIG / "foxglove.json").read_text())["configById"]
    paths = [path["value"] for panel in panels.values() for path in panel.get("paths", ())]

    assert panels["3D!model"]["topics"].keys() <= offered().keys()
    for path in paths:
        topic, _, fields = path.partition(".")
        message = offered()[topic].message_type()
        for field in fields.split("."):
            message = getattr(message, re.sub(r"\[.*", "", field))
