"""The commands that take a bag of any robot, as a user gives it to them."""

import json
import math
import re
import signal
import struct
from html import unescape
from pathlib import Path

import av
import numpy as np
import pytest
from matplotlib.image import imread
from rosbags.rosbag2 import StoragePlugin

from actuated_characters.bags.robots.reading import RobotSource, read_any
from actuated_characters.cli import main
from actuated_characters.runs.plan import make_plan
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import still_model
from msgs_config.character.model import Character
from tests.support.robot_bags import (
    JOINTS,
    ROLLER,
    Sent,
    joints,
    odometry,
    text,
    write_bag,
)
from tests.support.ros import Processes, wait_until
from tests.support.runs import run_plan_here

pytestmark = pytest.mark.sharing

TIMES = np.linspace(0.0, 2.0, 41)


def messages() -> list[Sent]:
    """A robot that goes 1 m along x and waves its arm."""
    sent = [joints(t, [*JOINTS, "lamp"], [math.sin(3.0 * t), 0.05, t, 0.0]) for t in TIMES]
    return sent + [odometry(t, "base_footprint", (0.5 * t, 0.0, 0.0)) for t in TIMES]


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> str:
    file = tmp_path_factory.mktemp("robot") / "roller.urdf"
    file.write_text(ROLLER)
    return str(file)


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    return write_bag(tmp_path / "bag", messages())


@pytest.fixture
def described(tmp_path: Path) -> Path:
    sent = [*messages(), text("/robot_description", ROLLER)]
    return write_bag(tmp_path / "described", sent, StoragePlugin.SQLITE3)


@pytest.mark.slow
def test_render_draws_it(bag: Path, robot: str, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--character", robot, "--topic", "/joint_states", "--count", "3"]

    assert main(["render", str(bag), *options, "--size", "64x48"]) == 0

    output = capsys.readouterr()
    assert "left out: lamp" in output.err
    picture = imread(bag / "strip.png")
    assert picture.shape[1] >= 3 * 64
    first, last = picture[:, :64], picture[:, -64:]
    assert np.abs(first - last).max() > 0.2  # the arm has moved


@pytest.mark.nightly
@pytest.mark.slow
def test_render_makes_a_film_of_a_bag_that_says_whose_it_is(described: Path) -> None:
    assert main(["render", str(described), "--video", "--size", "64x48", "--fps", "10"]) == 0

    with av.open(str(described / "video.mp4")) as film:
        count = sum(1 for _ in film.decode(video=0))
    assert count == 21  # 2 s


@pytest.mark.slow
def test_report_says_what_is_known_and_no_more(bag: Path, robot: str) -> None:
    assert main(["report", str(bag), "--character", robot, "--stills", "2"]) == 0

    page = (bag.with_name("bag-report") / "index.html").read_text()
    words = unescape(re.sub("<[^>]*>", " ", re.sub('data:[^"]*', "", page)))
    assert "41 states of '/joint_states' over 2 s, 20 a second." in words
    assert re.search(r"shoulder\s+rad\s+-0\.99\S*\s+\S+\s+0\.99\S*\s+-2\s+2", words)
    assert re.search(r"wheel\s+rad\s+0\s+1\s+2\s+-\s+-", words)  # without limits
    assert f"view {bag} --character {robot}" in words  # shows the rest
    for unknown in ("state_hash", "fell", "nan", "None", "control law"):
        assert unknown not in words
    assert main(["report", str(bag), "--character", robot, "--stills", "0"]) == 0  # replaces it


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["glb", "bvh"])
def test_export_writes_it(suffix: str, bag: Path, robot: str, tmp_path: Path) -> None:
    file = tmp_path / f"robot.{suffix}"
    options = ["--character", robot, "--output", str(file)]

    assert main(["export", str(bag), *options]) == 0

    if suffix == "bvh":
        frames = file.read_text().partition("Frame Time:")[2].split("\n")[1:]
        assert len([line for line in frames if line]) == 41
        return
    raw = file.read_bytes()
    (length,) = struct.unpack_from("<I", raw, 12)
    content = json.loads(raw[20 : 20 + length])
    names = {node.get("name", "") for node in content["nodes"]}
    assert any("arm" in name for name in names)
    assert content["animations"]


@pytest.mark.nightly
@pytest.mark.slow
def test_view_shows_it(described: Path, bag: Path, robot: str, processes: Processes) -> None:
    viewer = processes.command("view", str(described), str(bag), "--character", robot)

    wait_until(lambda: "http://127.0.0.1:" in viewer.stdout, "the page's address")
    viewer.end(signal.SIGINT)

    assert "note: the base is that of '/odom'" in viewer.stderr
    assert "Traceback" not in viewer.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ("render", "BAG"),
        ("report", "BAG"),
        ("view", "BAG"),
        ("export", "BAG", "--output", "robot.glb"),
        ("export", "BAG", "--output", "states.csv"),
    ],
    ids=" ".join,
)
def test_without_a_character_it_says_what_to_give(
    arguments: tuple[str, ...],
    bag: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)

    assert main([str(bag) if each == "BAG" else each for each in arguments]) == 1

    (line,) = capsys.readouterr().err.splitlines()
    assert "is not of this project's simulator (nothing on 'sim_node/configuration')" in line
    assert "give the robot by --character ROBOT.urdf" in line


@pytest.mark.parametrize(
    "arguments",
    [
        ("replay", "BAG"),
        ("fork", "BAG", "--at", "1"),
        ("compare", "BAG", "BAG"),
    ],
    ids=" ".join,
)
def test_commands_of_runs_say_what_the_bag_is_and_which_commands_take_it(
    arguments: tuple[str, ...],
    bag: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)

    assert main([str(bag) if each == "BAG" else each for each in arguments]) == 1

    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: bag ")
    assert "has joint states on /joint_states: `view`, `render`, `report` and `export`" in line
    assert "--character ROBOT.urdf --topic TOPIC" in line


def test_info_lists_the_topics_and_says_the_same(
    bag: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["info", str(bag)]) == 0

    output = capsys.readouterr().out
    assert "nav_msgs/msg/Odometry" in output
    assert "--character ROBOT.urdf --topic TOPIC" in " ".join(output.split())


def test_options_of_a_bag_are_refused_where_there_is_none(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    output = str(tmp_path / "walk.bvh")

    assert main(["export", "walk", "--topic", "/a", "--output", output]) == 1
    assert main(["view", "--topic", "/a"]) == 1

    lines = capsys.readouterr().err.splitlines()
    assert "--topic and --base are of a bag; walk is none" in lines[0]
    assert "--topic is of a recorded RUN; name one" in lines[1]


@pytest.mark.slow
def test_a_run_s_own_bag_read_as_any_robot_s_has_its_links_in_the_same_places(
    tmp_path: Path,
) -> None:
    reference = {"reference": "clip", "clip": "walk"}
    run_plan_here(make_plan("humanoid", 0.3, reference, {}, {}), tmp_path / "run")
    (run,) = read_any(tmp_path / "run", RobotSource())

    (robot,) = read_any(tmp_path / "run", RobotSource(topic="description_joint_states"))

    rows = np.searchsorted(run.stamps_ns, robot.stamps_ns)
    assert len(rows) >= 8
    np.testing.assert_array_equal(run.stamps_ns[rows], robot.stamps_ns)
    for row, position in zip(rows.tolist(), robot.position, strict=True):
        one, two = _places(run.character, run.position[row]), _places(robot.character, position)
        both = one.keys() & two.keys()  # the description's base is another frame
        assert len(both) >= 15
        for link in both:
            np.testing.assert_allclose(two[link], one[link], atol=1e-9)


def _places(character: Character, position: FloatArray) -> dict[str, FloatArray]:
    """Where the origins of the links are, by their names."""
    origins, _ = still_model(character, position).link_poses()
    names = [link.name for link in character.links]
    return dict(zip(names, origins, strict=True))
