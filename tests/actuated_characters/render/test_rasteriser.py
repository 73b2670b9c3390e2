"""Triangles in pictures, against rays that are cast one by one and against geometry."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import pi, sqrt
from pathlib import Path

import numpy as np
import pytest
import trimesh
from matplotlib.tri import Triangulation
from PIL import Image

from actuated_characters.render.engine.camera_pose import CameraPose, PixelRegion, Size
from actuated_characters.render.engine.rasteriser import AMBIENT, DIFFUSE
from actuated_characters.render.engine.render_scene import LIGHT_VIEW, Drawing, RenderScene
from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.character.model import Quadruple, Shape, ShapeType
from tests.support.pictures import points_at

SIZE: Size = (90, 60)
VIEW = CameraPose((0.1, -0.2, 0.3), distance=3.0, yaw=0.7, pitch=0.4, field_of_view=0.8)
AHEAD = CameraPose((0.0, 0.0, 0.0), distance=2.0, yaw=0.0, pitch=0.0, field_of_view=0.6)
NEAR = 0.02  # view distances, from which on something is drawn
WHITE = (1.0, 1.0, 1.0, 1.0)
LIGHT = LIGHT_VIEW.axes()[2]


def write_obj(path: Path, vertices: FloatArray, triangles: IntArray, more: str = "") -> Shape:
    """A mesh of a file with these vertices (m, 3), to the last digit; `more` goes before faces."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    corner = "{0}/{0}/{0}" if "vt" in more else "{0}//{0}" if "vn" in more else "{0}"
    faces = ["f " + " ".join(corner.format(v + 1) for v in row) for row in triangles.tolist()]
    path.write_text("\n".join([*lines, more, *faces, ""]))
    return Shape(ShapeType.MESH, (1.0, 1.0, 1.0), mesh=str(path))


def draw(
    shapes: Sequence[Shape],
    view: CameraPose,
    size: Size = SIZE,
    shown: Sequence[int] | None = None,
    box: PixelRegion | None = None,
) -> Drawing:
    """Shapes where they are, or those with some numbers alone."""
    scene = RenderScene([(shape,) for shape in shapes])
    return draw_links(scene, len(shapes), view, size, shown, box)


def draw_links(
    scene: RenderScene,
    count: int,
    view: CameraPose,
    size: Size,
    shown: Sequence[int] | None = None,
    box: PixelRegion | None = None,
) -> Drawing:
    origins = np.full((count, 3), np.nan)
    origins[slice(None) if shown is None else list(shown)] = 0.0
    scene.clear()
    scene.show_links((origins, np.tile((0.0, 0.0, 0.0, 1.0), (count, 1))), [None] * count)
    return scene.draw(view, size, box or PixelRegion(0, size[1], 0, size[0]))


def rays(view: CameraPose, size: Size) -> FloatArray:
    """Directions (h, w, 3) through the middles of pixels, of length one along the camera's axis."""
    pixels = np.mgrid[: size[1], : size[0]].reshape(2, -1)
    points = points_at(view, pixels, np.ones(pixels.shape[1]), size)
    return (points.T - view.eye()).reshape(size[1], size[0], 3)


@dataclass(frozen=True)
class Hits:
    """The nearest triangle that each ray meets from its outer side."""

    depth: FloatArray  # (h, w), infinite: none
    triangle: IntArray  # (h, w)
    is_near_edge: BoolArray  # (h, w)


def cast(view: CameraPose, size: Size, corners: FloatArray) -> Hits:
    """Cast a ray a pixel at triangles (k, 3, 3): Möller and Trumbore 1997."""
    along, eye = rays(view, size)[:, :, np.newaxis], view.eye()
    edge, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across = np.cross(along, other)
    determinant = (edge * across).sum(axis=-1)  # positive where it is seen from outside
    from_corner = eye - corners[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        u = (from_corner * across).sum(axis=-1) / determinant
        turned = np.cross(from_corner, edge)
        v = (along * turned).sum(axis=-1) / determinant
        depth = (other * turned).sum(axis=-1) / determinant
    margin = np.minimum(np.minimum(u, v), 1.0 - u - v)
    faces = (determinant > 0.0) & (depth >= NEAR * view.distance)
    depth = np.where(faces & (margin >= 0.0), depth, np.inf)
    near_edge = (faces & (np.abs(margin) < 1e-7)).any(axis=-1)
    return Hits(depth.min(axis=-1), depth.argmin(axis=-1), near_edge)


def lambert(normals: FloatArray) -> FloatArray:
    """The share (...) of a colour that surfaces with unit normals (..., 3) show."""
    return AMBIENT + DIFFUSE * np.maximum(normals @ LIGHT, 0.0)


@pytest.mark.parametrize("spread", [0.5, 3.0, 30.0], ids=["ahead", "around", "huge"])
@pytest.mark.parametrize("seed", [1, 2])
def test_each_sample_has_the_nearest_triangle_that_a_ray_meets(
    tmp_path: Path, spread: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    # some before the camera, some behind it, and some through the plane where drawing begins
    middles = VIEW.target + spread * rng.normal(size=(30, 1, 3))
    corners = middles + 0.4 * spread * rng.normal(size=(30, 3, 3))
    colors = rng.uniform(0.2, 0.9, size=(30, 3))
    shapes = [
        replace(
            write_obj(tmp_path / f"{number}.obj", own, np.array([(0, 1, 2)])),
            color_rgba=(*color, 1.0),
        )
        for number, (own, color) in enumerate(zip(corners, colors.tolist(), strict=True))
    ]
    along = (corners - VIEW.eye()) @ -VIEW.axes()[2]
    if spread > 0.5:
        assert (along < 0.0).all(axis=1).any()
        assert ((along < NEAR * VIEW.distance).any(axis=1) & (along > 0.0).any(axis=1)).any()

    drawing = draw(shapes, VIEW)

    hits = cast(VIEW, SIZE, corners)
    sure = ~hits.is_near_edge
    assert sure.mean() > 0.999 and np.isfinite(hits.depth).mean() > 0.02
    np.testing.assert_allclose(drawing.depth[sure], hits.depth[sure], rtol=1e-5)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    shares = lambert(normals / np.linalg.norm(normals, axis=1, keepdims=True))
    expected = np.minimum(255.0 * shares[:, np.newaxis] * colors, 255.0)[hits.triangle]
    expected[np.isinf(hits.depth)] = 0.0
    np.testing.assert_allclose(drawing.color[sure], expected[sure], atol=1e-3)
    np.testing.assert_array_equal(drawing.casts_shadow, np.isfinite(drawing.depth))


def test_a_part_of_a_picture_is_what_the_whole_has_there(tmp_path: Path) -> None:
    corners = VIEW.target + np.random.default_rng(3).normal(size=(20, 3, 3))
    shape = write_obj(tmp_path / "soup.obj", corners.reshape(-1, 3), np.arange(60).reshape(-1, 3))
    whole, box = draw([shape], VIEW), PixelRegion(7, 41, 20, 66)

    part = draw([shape], VIEW, box=box)

    np.testing.assert_array_equal(part.depth, whole.depth[box.part])
    np.testing.assert_array_equal(part.color, whole.color[box.part])


@pytest.mark.parametrize("aligned", [False, True], ids=["anywhere", "on samples"])
def test_triangles_with_common_edges_cover_each_sample_once(tmp_path: Path, aligned: bool) -> None:
    rng = np.random.default_rng(4)
    width, height = SIZE
    columns, rows = rng.uniform(0.1, 0.9, size=(2, 40)) * ((width,), (height,))
    if aligned:
        columns, rows = np.unique(np.rint((columns, rows)), axis=1)
    columns = np.concatenate((columns, (-5.0, -5.0, width + 5.0, width + 5.0)))
    rows = np.concatenate((rows, (-5.0, height + 5.0, -5.0, height + 5.0)))
    triangles = Triangulation(columns, -rows).triangles
    depth = rng.uniform(1.0, 2.0, size=len(rows))
    vertices = points_at(AHEAD, np.array((rows, columns)), depth, SIZE).T
    shapes = [
        write_obj(tmp_path / f"{number}.obj", vertices, own[np.newaxis])
        for number, own in enumerate(triangles)
    ]
    scene = RenderScene([(shape,) for shape in shapes])

    covered = sum(
        np.isfinite(draw_links(scene, len(shapes), AHEAD, SIZE, [number]).depth).astype(int)
        for number in range(len(shapes))
    )

    np.testing.assert_array_equal(covered, np.ones((height, width)))


# A ball, of which geometry knows all


@pytest.fixture(scope="module")
def ball(tmp_path_factory: pytest.TempPathFactory) -> Shape:
    """A ball of radius 0.5 m of 80,000 triangles, with its normals."""
    sphere = trimesh.creation.icosphere(subdivisions=6, radius=0.5)
    normals = 2.0 * np.array(sphere.vertices)
    lines = "\n".join(f"vn {x!r} {y!r} {z!r}" for x, y, z in normals.tolist())
    folder = tmp_path_factory.mktemp("ball")
    return write_obj(folder / "ball.obj", np.array(sphere.vertices), sphere.faces, lines)


def test_a_ball_is_seen_as_large_as_far_away_and_as_bright_as_it_is(ball: Shape) -> None:
    size = (200, 200)

    drawing = draw([ball], AHEAD, size)

    seen = np.isfinite(drawing.depth)
    # the cone from the camera that touches a ball: its half angle's sine is radius over distance
    radius = 0.5 / sqrt(AHEAD.distance**2 - 0.5**2) / AHEAD.pixel(size[1])
    assert seen.sum() == pytest.approx(pi * radius**2, rel=2e-3)
    assert np.argwhere(seen).mean(axis=0) + 0.5 == pytest.approx((100.0, 100.0), abs=0.02)
    along, eye = rays(AHEAD, size)[seen], AHEAD.eye()
    a, b = (along**2).sum(axis=-1), along @ eye
    inside = b**2 - a * (eye @ eye - 0.5**2)
    sure = inside > 1e-3  # not at the rim, where depth and normal change fast
    depth = (-b - np.sqrt(np.maximum(inside, 0.0))) / a
    np.testing.assert_allclose(drawing.depth[seen][sure], depth[sure], atol=1e-3)
    normals = 2.0 * (eye + depth[:, np.newaxis] * along)
    expected = np.minimum(255.0 * 0.7 * lambert(normals), 255.0)
    np.testing.assert_allclose(drawing.color[seen][sure][:, 0], expected[sure], atol=0.6)


def test_from_within_and_from_behind_a_ball_is_not_seen(ball: Shape) -> None:
    within, before = replace(AHEAD, distance=0.3), replace(AHEAD, target=(0.0, -5.0, 0.0))

    for view in (within, replace(before, yaw=pi)):
        assert not draw([ball], view).casts_shadow.any()


# Textures


def test_a_texture_lies_upright_and_multiplies_the_colour(tmp_path: Path) -> None:
    texels = np.array([[(255, 0, 0), (0, 255, 0)], [(0, 0, 255), (255, 255, 255)]], np.uint8)
    (tmp_path / "of two.mtl").write_text("newmtl other\nnewmtl a b\nmap_Kd four.png\n")
    Image.fromarray(texels).save(tmp_path / "four.png")
    square = np.array([(-1.0, 0.0, -1.0), (1.0, 0.0, -1.0), (1.0, 0.0, 1.0), (-1.0, 0.0, 1.0)])
    more = "mtllib of two.mtl\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n" + 4 * "vn 0 -1 0\n" + "usemtl a b"
    shape = write_obj(tmp_path / "square.obj", square, np.array([(0, 1, 2), (0, 2, 3)]), more)
    light = float(lambert(np.array((0.0, -1.0, 0.0))))
    color: Quadruple = (0.5, 0.6, 0.7, 1.0)

    drawing = draw([replace(shape, color_rgba=color)], replace(AHEAD, distance=9.0), (120, 120))

    (top, left), (bottom, right) = (
        edge(np.argwhere(np.isfinite(drawing.depth)), axis=0) for edge in (np.min, np.max)
    )
    corners = drawing.color[[top, top, bottom, bottom], [left, right, left, right]].reshape(2, 2, 3)
    np.testing.assert_allclose(corners, light * texels * np.array(color[:3]), atol=1e-3)


@pytest.mark.parametrize("content", [None, b"", b"no picture", b"\x89PNG\r\n\x1a\nbroken"])
def test_without_a_readable_texture_a_mesh_has_its_colour(
    tmp_path: Path, content: bytes | None
) -> None:
    (tmp_path / "x.mtl").write_text("newmtl x\nmap_Kd x.png\n")
    if content is not None:
        (tmp_path / "x.png").write_bytes(content)
    corners = np.array([(-1.0, 0.0, -1.0), (1.0, 0.0, -1.0), (0.0, 0.0, 1.0)])
    shape = write_obj(tmp_path / "x.obj", corners, np.array([(0, 1, 2)]), "mtllib x.mtl\nusemtl x")

    drawing = draw([shape], AHEAD)

    expected = 0.7 * 255.0 * float(lambert(np.array((0.0, -1.0, 0.0))))
    assert drawing.color[drawing.casts_shadow] == pytest.approx(expected, abs=1e-3)


# What is not there, or hardly


def test_nothing_shown_is_nothing_drawn() -> None:
    drawing = draw([], VIEW)

    assert np.isinf(drawing.depth).all() and not drawing.color.any()
    assert drawing.color.shape == (60, 90, 3)


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf, 1e300])
def test_what_is_nowhere_or_too_far_away_is_not_drawn(number: float) -> None:
    scene = RenderScene([(Shape(ShapeType.BOX, (1.0, 1.0, 1.0)),)])

    for axis in range(3):
        origin, turn = np.zeros((1, 3)), np.array([(0.0, 0.0, 0.0, 1.0)])
        origin[0, axis] = number
        scene.clear()
        with np.errstate(invalid="ignore", over="ignore"):
            scene.show_links((origin, turn), [None])
            scene.show_links((np.zeros((1, 3)), turn * number), [None])
            drawing = scene.draw(AHEAD, SIZE, PixelRegion(0, SIZE[1], 0, SIZE[0]))
        assert np.isinf(drawing.depth).all()


def test_a_mesh_without_area_is_not_drawn(tmp_path: Path) -> None:
    line = np.array([(-1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
    shape = write_obj(tmp_path / "line.obj", line, np.array([(0, 1, 2)]))

    assert not draw([shape], AHEAD).casts_shadow.any()
