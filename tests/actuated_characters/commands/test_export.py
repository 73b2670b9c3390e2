"""`export` of runs, bags and clips: the motion in its files, and what is refused in one line."""

from pathlib import Path

import numpy as np
import pytest

from actuated_characters.bags.recording import read_recording
from actuated_characters.bags.writer import BagWriter
from actuated_characters.cli import main
from actuated_characters.export.sources import of_recordings, read_source
from character_motion.bvh.kinematics import forward_kinematics
from character_motion.bvh.reading import read_bvh
from controller_node.planner.policy.file import shipped_policies
from msgs_config.character.dynamics import still_model
from msgs_config.clips.reading import clip_path
from msgs_config.messages import topics
from tests.support.bags import Made, add_to, make_run, raw_configuration, raw_states, write_bag
from tests.support.eventful import Eventful, eventful_run, write_timed
from tests.support.gltf import Gltf, assert_valid
from tests.support.limits import file_size_limit
from tests.support.physics import character
from tests.support.skins import skinned_glb

TO_FILE = [1, 2, 0]  # of x, y, z: y is up, forward is z
RESET_AFTER = 30
CLOSE = 2e-5  # m


@pytest.fixture(scope="module")
def dropped() -> Eventful:
    """A humanoid that holds itself, with a reset."""
    return eventful_run("humanoid", 60, reset_after=RESET_AFTER)


@pytest.fixture(scope="module")
def bag(dropped: Eventful, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_timed(tmp_path_factory.mktemp("run") / "bag", dropped.messages())


@pytest.fixture(scope="module")
def pendulum() -> Made:
    return make_run("pendulum", 0.05)


def exported(*arguments: str | Path) -> int:
    return main(["export", *map(str, arguments)])


def refused(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> str:
    """The one line of an export that ends with an error."""
    assert exported(*arguments) == 1
    line = capsys.readouterr().err
    assert line.startswith("error: ") and line.count("\n") == 1
    return line


@pytest.mark.parametrize("suffix", [".glb", ".gltf", ".bvh"])
def test_a_run_is_there_state_by_state(
    bag: Path, dropped: Eventful, tmp_path: Path, suffix: str
) -> None:
    file, rate = tmp_path / f"motion{suffix}", 240.0

    assert exported(bag.parent, "--output", file, "--fps", rate) == 0

    whole = dropped.plan.character
    expected = [still_model(whole, s.position).link_poses()[0][:, TO_FILE] for s in dropped.states]
    ankle = [link.name for link in whole.links].index("left_ankle")
    if suffix == ".bvh":
        motion = read_bvh(file)
        joint = motion.skeleton.names.index("left_ankle")
        found = forward_kinematics(motion).positions[:, joint]
    else:
        read = Gltf.of_glb if suffix == ".glb" else Gltf.of_text
        gltf = read(file.read_bytes())
        assert_valid(gltf)
        node = gltf.node("left_ankle")
        found = np.array([gltf.poses(k / rate)[node][:3, 3] for k in range(len(expected))])
    np.testing.assert_allclose(found, np.array(expected)[:, ankle], atol=CLOSE)


def test_the_usual_rate_is_the_runs_own_divided_and_a_part_can_be_taken(
    bag: Path, tmp_path: Path
) -> None:
    file = tmp_path / "part.bvh"

    assert exported(bag, "--output", file, "--from", "0.05", "--to", "0.1", "--units", "cm") == 0

    motion, recording = read_bvh(file), read_recording(bag)
    assert motion.frame_time == pytest.approx(1.0 / 60.0)  # of 240 Hz, every fourth state
    assert len(motion.values) == 4
    expected = 100.0 * recording.position[[12, 16, 20, 24], :3][:, TO_FILE]
    np.testing.assert_allclose(motion.values[:, :3], expected, atol=1e-5)


def test_nothing_lies_between_two_episodes(bag: Path) -> None:
    motion = of_recordings((read_recording(bag),))
    (trajectory,) = motion.characters
    step = 1.0 / 240.0
    around = (RESET_AFTER + np.array((0.4, 0.6))) * step

    poses = motion.link_poses(trajectory, around)

    expected = motion.link_poses(trajectory, (RESET_AFTER + np.array((0.0, 1.0))) * step)
    np.testing.assert_allclose(poses.origins, expected.origins, atol=1e-9)


@pytest.mark.parametrize("order", ["ZXY", "ZYX"])
def test_a_clip_by_name_or_file_is_the_same_motion(tmp_path: Path, order: str) -> None:
    by_name, by_file = tmp_path / "name.bvh", tmp_path / "file.bvh"
    path = clip_path(character("humanoid"), "cartwheel")

    assert exported("cartwheel", "--output", by_name, "--order", order) == 0
    assert exported(path, "--output", by_file, "--order", order, "--character", "humanoid") == 0

    assert by_name.read_bytes() == by_file.read_bytes()
    channels = read_bvh(by_name).skeleton.channels[0]
    assert "".join(channel[0] for channel in channels[3:]) == order


def test_of_two_worlds_one_is_named(
    pendulum: Made, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        for namespace in ("left", "right"):
            add_to(bag, pendulum.messages(), namespace)
    file = tmp_path / "one.glb"

    assert "several worlds" in refused(capsys, tmp_path, "--output", file)
    assert exported(tmp_path, "--output", file, "--character", "right") == 0
    assert_valid(Gltf.of_glb(file.read_bytes()))


def test_a_world_of_two_gives_both_and_bvh_one_of_them(
    pendulum: Made, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names, states = ("left", "right"), raw_states(pendulum.plan, pendulum.states)
    with BagWriter(tmp_path / "bag") as bag:
        for name in names:
            add_to(bag, [raw_configuration(pendulum.plan, name, names), *states], name)
    both, one = tmp_path / "both.glb", tmp_path / "one.bvh"

    assert exported(tmp_path, "--output", both) == 0
    gltf = Gltf.of_glb(both.read_bytes())
    assert_valid(gltf)
    link = pendulum.plan.character.links[-1].name
    left, right = (gltf.poses(0.05)[gltf.node(f"{name}_{link}")] for name in names)
    np.testing.assert_array_equal(left, right)
    assert "by --character: left, right" in refused(capsys, tmp_path, "--output", one)
    assert exported(tmp_path, "--output", one, "--character", "left") == 0


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (("walk", "--output", "walk.fbx"), (".csv", ".bvh", ".glb", "walk.fbx")),
        (("walk", "--output", "nowhere/walk.glb"), ("nowhere", "does not exist")),
        (("walk", "--output", "walk.glb", "--units", "cm"), ("--units", "BVH")),
        (("walk", "--output", "walk.bvh", "--ground"), ("--ground", "glTF")),
        (("walk", "--output", "walk.bvh", "--shapes"), ("--shapes", "glTF")),
        (("walk", "--output", "walk.bvh", "--skin", "a.glb"), ("--skin is of glTF",)),
        (("walk", "--output", "walk.glb", "--skin", "a.glb"), ("cannot read a.glb",)),
        (("walk", "--output", "walk.glb", "--skin-map", "a.yaml"), ("--skin-map is of a --skin",)),
        (("walk", "--output", "walk.glb", "--skin", "a", "--shapes"), ("one of the two",)),
        (("walk", "--output", "walk.csv", "--order", "XYZ"), ("--order is of BVH; walk.csv",)),
        (("walk", "--output", "walk.csv", "--from", "0"), ("--from is of BVH and glTF; walk.csv",)),
        (("walk", "--output", "walk.glb", "--reference"), ("--reference is of CSV; walk.glb",)),
        (("walk", "--output", "walk.csv", "--reference"), ("--reference is of a run; walk",)),
        (("walk", "--output", "walk.csv", "--topic", "/a"), ("--topic", "of a bag")),
        (("walk", "--output", "walk.onnx", "--topic", "/a"), ("--topic is of CSV and BVH",)),
        (("walk", "--output", "walk.onnx", "--character", "laikago"), ("does not fit 'laikago'",)),
        (
            ("wlak", "--output", "walk.onnx"),
            ("'wlak'", ", ".join(shipped_policies())),
        ),
        (("wlak", "--output", "walk.bvh"), ("wlak", "walk")),
        (("nowhere/run", "--output", "walk.bvh"), ("nowhere/run",)),
        (("nowhere.mcap", "--output", "walk.bvh"), ("nowhere.mcap",)),
        (("nowhere.txt", "--output", "walk.bvh"), ("nowhere.txt",)),
        (("walk", "--output", "walk.bvh", "--character", "r3d3"), ("r3d3",)),
        (("walk", "--output", "walk.bvh", "--from", "1", "--to", "0.5"), ("from 1 s to 0.5 s",)),
        (("walk", "--output", "walk.bvh", "--to", "9"), ("to 9 s", "1.2")),
        (("walk", "--output", "walk.bvh", "--from", "nan"), ("nan",)),
        (("walk", "--output", "walk.bvh", "--fps", "0"), ("0 frames a second", "positive")),
        (("walk", "--output", "walk.bvh", "--fps", "nan"), ("nan", "positive")),
        (("walk", "--output", "walk.bvh", "--fps", "1e9"), ("100000 or fewer",)),
    ],
    ids=lambda value: " ".join(value[1:]) if "--output" in value else "",
)
def test_what_cannot_be_is_one_line(
    arguments: tuple[str, ...],
    parts: tuple[str, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)

    line = refused(capsys, *arguments)

    assert all(part in line for part in parts), line
    assert not list(tmp_path.iterdir())


def test_a_bag_without_states_is_one_line(
    dropped: Eventful, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    messages = [each for each in dropped.messages() if each[0][0] is not topics.JOINT_STATES]
    bag = write_timed(tmp_path / "bag", messages)

    assert "bag" in refused(capsys, bag, "--output", tmp_path / "motion.glb")


def test_a_world_without_a_plane_has_no_ground(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = write_bag(tmp_path / "bag", make_run("pendulum", 0.02, terrain="none").messages())

    assert "no plane" in refused(capsys, bag, "--output", tmp_path / "motion.glb", "--ground")
    assert exported(bag, "--output", tmp_path / "motion.glb") == 0


def test_a_full_disk_leaves_what_was_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "walk.glb"
    file.write_text("mine")

    assert "exists already" in refused(capsys, "walk", "--output", file)
    with file_size_limit(100_000):  # enough for the copy of the URDF that is loaded
        line = refused(capsys, "walk", "--output", file, "--overwrite")

    assert line == f"error: cannot write {file}: File too large\n"
    assert file.read_text() == "mine" and len(list(tmp_path.iterdir())) == 1
    assert exported("walk", "--output", file, "--overwrite") == 0
    assert_valid(Gltf.of_glb(file.read_bytes()))


def test_a_mesh_from_a_file_follows_the_links(tmp_path: Path) -> None:
    body, file = tmp_path / "body.glb", tmp_path / "walk.glb"
    body.write_bytes(skinned_glb(scale=100.0))

    assert exported("walk", "--output", file, "--skin", body, "--from", "0.5", "--to", "0.5") == 0

    gltf = Gltf.of_glb(file.read_bytes())
    assert_valid(gltf)
    (upper_and_lower,) = gltf.skinned(gltf.node("skin"), 0.0)
    assert upper_and_lower[:, 1].min() == pytest.approx(0.0, abs=0.03)  # y is up
    assert 1.4 < upper_and_lower[:, 1].max() < 1.7
    mesh = gltf.content["meshes"][gltf.content["nodes"][gltf.node("skin")]["mesh"]]
    colors = gltf.numbers(mesh["primitives"][0]["attributes"]["COLOR_0"])
    assert len(np.unique(colors.round(4), axis=0)) == 2


def test_a_single_file_of_a_bag_will_do(bag: Path) -> None:
    (file,) = bag.glob("*.mcap")

    assert len(read_source(str(file)).times) == len(read_source(str(bag)).times)
