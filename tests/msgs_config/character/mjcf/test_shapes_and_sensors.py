"""Geoms of an MJCF as shapes of links, and its sites as sensors."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointType
from msgs_config.character.loading import load_character
from msgs_config.character.meshes.triangles import read_vertices
from msgs_config.character.model import Character, Shape, ShapeType
from msgs_config.character.sensors import SensorType
from msgs_config.errors import CharacterError
from msgs_config.geometry import rotations
from tests.support.mjcf import arm, load_mjcf, torso, write_mjcf

HINGE = '<joint name="h" pos="0.1 0.2 0.3"/>'
ANCHOR = np.array((0.1, 0.2, 0.3))  # m, in the body: there the link begins
WEDGE = "v 0 0 0\nv 1 0 0\nv 0 0.5 0\nv 0 0 0.2\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


def shapes(folder: Path, geoms: str) -> tuple[Shape, ...]:
    """The shapes of an arm with geoms, that collide."""
    return load_mjcf(folder, arm(HINGE, geoms)).links[-1].collision_shapes


def placed(shape: Shape, points: FloatArray) -> FloatArray:
    """Points (m, 3) of a shape in its link."""
    turn = np.array(shape.pose.orientation_xyzw)
    return np.array(shape.pose.position) + rotations.rotate(turn, points)


def test_a_capsule_from_one_point_to_another_ends_there(tmp_path: Path) -> None:
    (capsule,) = shapes(tmp_path, '<geom type="capsule" fromto="0.1 0 0 0.4 0.4 1.2" size="0.05"/>')

    radius, length = capsule.size
    ends = placed(capsule, np.array([[0.0, 0.0, 0.5 * length], [0.0, 0.0, -0.5 * length]]))

    assert (capsule.type, radius) == (ShapeType.CAPSULE, 0.05)
    expected = np.array([[0.1, 0.0, 0.0], [0.4, 0.4, 1.2]]) - ANCHOR
    np.testing.assert_allclose(sorted(ends.tolist()), sorted(expected.tolist()), atol=1e-12)


KINDS = {
    "box": ('<geom type="box" size="0.1 0.2 0.3"/>', ShapeType.BOX, (0.2, 0.4, 0.6)),
    "sphere": ('<geom size="0.1"/>', ShapeType.SPHERE, (0.1,)),
    "cylinder": ('<geom type="cylinder" size="0.1 0.2"/>', ShapeType.CYLINDER, (0.1, 0.4)),
}


@pytest.mark.parametrize(("geom", "kind", "size"), KINDS.values(), ids=KINDS)
def test_sizes_are_whole_lengths(
    tmp_path: Path, geom: str, kind: ShapeType, size: tuple[float, ...]
) -> None:
    (shape,) = shapes(tmp_path, geom)

    assert shape.type is kind
    assert shape.size == pytest.approx(size)
    np.testing.assert_allclose(shape.pose.position, -ANCHOR)


MOVED = {
    "": "",
    "scaled": 'scale="0.5 -0.4 0.3"',
    "moved": 'refpos="0.1 0.2 0.3" scale="2 3 4"',
    "turned": 'refpos="0.1 0.2 0.3" refquat="1 2 3 4" scale="0.5 0.5 0.5"',
}


@pytest.mark.parametrize("attributes", MOVED.values(), ids=MOVED)
def test_a_mesh_is_where_mujoco_has_its_vertices(tmp_path: Path, attributes: str) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "wedge.obj").write_text(WEDGE)
    rest = f'<asset><mesh name="m" file="meshes/wedge.obj" {attributes}/></asset>'
    geom = '<geom type="mesh" mesh="m" pos="1 2 3" euler="0.1 0.2 0.3"/>'
    path = write_mjcf(tmp_path, arm(HINGE, geom), rest)

    (shape,) = load_character(path).links[-1].collision_shapes

    assert Path(shape.mesh) == tmp_path / "meshes" / "wedge.obj"
    own = placed(shape, read_vertices(Path(shape.mesh)) * np.array(shape.size)) + ANCHOR
    model = mujoco.MjModel.from_xml_path(str(path))
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[0])
    theirs = model.geom_pos[0] + model.mesh_vert.astype(float) @ turn.reshape(3, 3).T
    for vertex in theirs:
        assert np.abs(own - vertex).max(axis=1).min() < 1e-6


@pytest.mark.parametrize("rest", ["", '<sensor><touch site="of_a_scene"/></sensor>'])
def test_a_mesh_of_a_model_that_is_attached_is_beside_its_own_file(
    tmp_path: Path, rest: str
) -> None:
    part, whole = tmp_path / "part", tmp_path / "whole"
    (part / "meshes").mkdir(parents=True)
    whole.mkdir()
    (part / "meshes" / "wedge.obj").write_text(WEDGE)
    assets = '<asset><mesh name="m" file="meshes/wedge.obj"/></asset>'
    write_mjcf(part, arm(HINGE, '<geom type="mesh" mesh="m"/>'), assets)
    attached = '<asset><model name="part" file="../part/robot.xml"/></asset>'
    path = write_mjcf(whole, '<attach model="part" body="arm" prefix="a_"/>', attached + rest)

    (shape,) = load_character(path).links[-1].collision_shapes

    assert Path(shape.mesh).resolve() == part / "meshes" / "wedge.obj"


def test_groups_and_bits_say_what_is_seen_and_what_collides(tmp_path: Path) -> None:
    geoms = (
        '<geom size="0.1" contype="0" conaffinity="0" rgba="1 0 0 1"/>'
        '<geom size="0.2" group="3"/><geom size="0.3" material="m"/>'
    )
    rest = '<asset><material name="m" rgba="0 1 0 1"/></asset>'

    link = load_mjcf(tmp_path, arm(HINGE, geoms), rest).links[-1]

    assert [shape.size for shape in link.shapes] == [(0.1,), (0.3,)]
    assert [shape.color_rgba for shape in link.shapes] == [
        (1.0, 0.0, 0.0, 1.0),
        (0.0, 1.0, 0.0, 1.0),
    ]
    assert [shape.size for shape in link.collision_shapes] == [(0.2,), (0.3,)]


def test_what_does_not_meet_the_floor_does_not_collide(tmp_path: Path) -> None:
    floor = '<geom name="floor" type="plane" size="1 1 1" contype="2" conaffinity="4"/>'
    geoms = '<geom size="0.1"/><geom size="0.2" conaffinity="2"/><geom size="0.3" contype="4"/>'

    character = load_mjcf(tmp_path, floor + arm(HINGE, geoms))

    assert [shape.size for shape in character.links[-1].collision_shapes] == [(0.2,), (0.3,)]
    assert any(
        "left out: geoms of the world" in line and "floor" in line for line in character.warnings
    )


def test_a_mesh_that_is_missing_is_none_where_nothing_collides(tmp_path: Path) -> None:
    rest = '<asset><mesh name="m" file="gone.stl"/></asset>'
    inertia = '<inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/>'
    geom = '<geom name="g" type="mesh" mesh="m"/>'
    path = write_mjcf(tmp_path, arm(HINGE, inertia + geom), rest)

    with pytest.raises(CharacterError, match=r"gone.stl.*'collision: none' does without"):
        load_character(path)
    character = load_character(path, collides=False)

    assert character.links[-1].shapes == ()
    assert character.mass == 1.0


def test_an_inertia_needs_its_mesh(tmp_path: Path) -> None:
    rest = '<asset><mesh name="m" file="gone.stl"/></asset>'
    geom = '<geom name="g" type="mesh" mesh="m"/>'
    path = write_mjcf(tmp_path, arm(HINGE, geom), rest)

    with pytest.raises(
        CharacterError, match=r"body 'arm' has the inertia of a mesh that is missing"
    ):
        load_character(path, collides=False)


def test_sensors_at_a_site_are_an_imu_in_its_place(tmp_path: Path) -> None:
    site = '<site name="waist-imu" pos="0.1 0.2 0.4" euler="0 0 0.5"/><site name="sole"/>'
    sensors = (
        '<sensor><accelerometer site="waist-imu"/><gyro site="waist-imu" noise="0.01"/>'
        '<touch name="t" site="sole"/><jointpos joint="h"/>'
        '<velocimeter name="v" site="sole"/></sensor>'
    )

    character = load_mjcf(tmp_path, arm(HINGE, f'<geom size="0.1"/>{site}'), sensors)

    imu, force = character.sensors
    assert (imu.type, imu.name, imu.link) == (SensorType.IMU, "waist_imu", "arm")
    np.testing.assert_allclose(imu.position, (0.0, 0.0, 0.1), atol=1e-15)
    np.testing.assert_allclose(imu.orientation_xyzw, (0.0, 0.0, np.sin(0.25), np.cos(0.25)))
    assert imu.noise["angular_velocity"].stddev == (0.01,) * 3
    assert (force.type, force.name, force.link) == (SensorType.FORCE, "sole", "arm")
    assert "left out: sensors (1): v" in character.warnings


def test_what_touches_a_body_without_shapes_is_not_felt(tmp_path: Path) -> None:
    geom = '<geom type="ellipsoid" size="0.1 0.1 0.2"/><site name="sole"/>'
    sensors = '<sensor><touch name="t" site="sole"/></sensor>'

    character = load_mjcf(tmp_path, arm(HINGE, geom), sensors)

    assert character.sensors == ()
    assert "left out: sensors (1): t" in character.warnings


def test_the_tree_that_moves_most_is_the_character(tmp_path: Path) -> None:
    table = '<body name="table"><geom type="box" size="1 1 1"/></body>'
    box = '<body name="box"><freejoint/><geom size="0.1"/></body>'

    character = load_mjcf(tmp_path, table + box + torso(arm('<joint name="h"/>')))

    assert [link.name for link in character.links] == ["torso", "arm"]
    assert character.layout.joints[0].type is JointType.FLOATING
    assert "left out: bodies beside the character (2): table, box" in character.warnings


def test_a_box_that_floats_is_a_character_and_a_table_is_none(tmp_path: Path) -> None:
    box: Character = load_mjcf(tmp_path, '<body name="b"><freejoint/><geom size="0.1"/></body>')

    assert box.layout.size == 6
    with pytest.raises(
        CharacterError, match="no body has a joint; a character needs one that moves"
    ):
        load_mjcf(tmp_path, '<body><geom size="0.1"/></body>')
