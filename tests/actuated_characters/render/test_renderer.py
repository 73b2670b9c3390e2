"""Pictures: a pinhole camera sees what theory says it does, of every character."""

import subprocess
import sys
import time
from math import cos, pi, sin, tan
from pathlib import Path

import numpy as np
import pytest

from actuated_characters.render.engine.camera_pose import CameraPose
from actuated_characters.render.engine.renderer import Picture, Renderer
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character, UrdfOptions
from msgs_config.errors import CharacterError
from tests.support.physics import EVERY_CHARACTER, character, character_id, random_state
from tests.support.pictures import followed, take_picture, view_of

BOX = (0.4, 0.2, 0.6)  # m
SIZE = (320, 240)
UPRIGHT = CameraPose((0.0, 0.0, 0.0), distance=3.0, yaw=0.0, pitch=0.0, field_of_view=0.6)
STILL = np.zeros(6)
STEP = 0.25  # m that a box is moved
GHOST_GREEN = 1  # the channel in which a ghost is strongest


def make_box(folder: Path, edges: tuple[float, ...] = BOX) -> Character:
    """A free box around the origin of its frame."""
    path = folder / "box.urdf"
    size = " ".join(map(str, edges))
    path.write_text(
        '<robot name="box"><link name="box"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial><visual><geometry>'
        f'<box size="{size}"/></geometry></visual></link></robot>'
    )
    return load_character(str(path))


@pytest.fixture(scope="module")
def box(tmp_path_factory: pytest.TempPathFactory) -> Character:
    return make_box(tmp_path_factory.mktemp("box"))


@pytest.fixture(scope="module")
def camera(box: Character) -> Renderer:
    """A camera that has only the box before it, one sample a pixel."""
    return Renderer(box, ground=False, samples=1)


def seen(picture: Picture) -> BoolArray:
    """Where there is something, before a background of one colour, which the first pixel has."""
    different: BoolArray = (picture != picture[0, 0]).any(axis=2)
    return different


def box_of(mask: BoolArray) -> tuple[FloatArray, FloatArray]:
    """First and last row and column of what is seen."""
    places = np.argwhere(mask)
    return places.min(axis=0), places.max(axis=0)


def centre(mask: BoolArray) -> FloatArray:
    """Mean row and column of what is seen."""
    middle: FloatArray = np.argwhere(mask).mean(axis=0) + 0.5
    return middle


def at(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> FloatArray:
    return np.array((x, y, z, 0.0, 0.0, 0.0))


# The pinhole model


@pytest.mark.parametrize("size", [(320, 240), (100, 300), (511, 77)])
@pytest.mark.parametrize("view", [UPRIGHT, CameraPose((0, 0, 0), 5.0, 0.0, 0.0, 1.0)])
def test_a_box_covers_as_many_pixels_as_the_pinhole_model_says(
    camera: Renderer, view: CameraPose, size: tuple[int, int]
) -> None:
    width, height = size

    (top, left), (bottom, right) = box_of(seen(take_picture(camera, STILL, view=view, size=size)))

    # the nearer face is seen; one pixel is as many metres there
    pixel = 2.0 * (view.distance - 0.5 * BOX[1]) * tan(0.5 * view.field_of_view) / height
    assert right - left + 1 == pytest.approx(min(BOX[0] / pixel, width), abs=1.01)
    assert bottom - top + 1 == pytest.approx(min(BOX[2] / pixel, height), abs=1.01)
    assert 0.5 * (left + right + 1) == pytest.approx(0.5 * width, abs=1.0)
    assert 0.5 * (top + bottom + 1) == pytest.approx(0.5 * height, abs=1.0)


@pytest.mark.parametrize(
    ("yaw", "pitch", "moved", "direction"),
    [
        (0.0, 0.0, (STEP, 0.0, 0.0), (0.0, 1.0)),  # rows, columns
        (0.0, 0.0, (0.0, 0.0, STEP), (-1.0, 0.0)),
        (0.5 * pi, 0.0, (0.0, STEP, 0.0), (0.0, 1.0)),
        (pi, 0.0, (STEP, 0.0, 0.0), (0.0, -1.0)),
        (0.0, 1.5, (0.0, STEP, 0.0), (-sin(1.5), 0.0)),
        (0.0, 0.7, (0.0, 0.0, STEP), (-cos(0.7), 0.0)),
    ],
)
def test_what_moves_in_the_world_moves_as_far_in_the_picture(
    tmp_path: Path,
    yaw: float,
    pitch: float,
    moved: tuple[float, float, float],
    direction: tuple[float, float],
) -> None:
    view = CameraPose((0.0, 0.0, 0.0), distance=50.0, yaw=yaw, pitch=pitch, field_of_view=0.03)
    pixel = 2.0 * 50.0 * tan(0.015) / SIZE[1]  # m; from so far away, nearly everywhere

    camera = Renderer(make_box(tmp_path, (0.1, 0.1, 0.1)), ground=False, samples=1)
    before = centre(seen(take_picture(camera, STILL, view=view, size=SIZE)))
    after = centre(seen(take_picture(camera, at(*moved), view=view, size=SIZE)))

    np.testing.assert_allclose(after - before, np.array(direction) * STEP / pixel, atol=1.0)


def test_what_is_farther_away_is_smaller(camera: Renderer) -> None:
    near, far = (
        seen(take_picture(camera, at(y=y), view=UPRIGHT, size=SIZE)).sum() for y in (0.0, 3.0)
    )

    # areas are as the squares of the distances of the nearer face
    assert near / far == pytest.approx((5.9 / 2.9) ** 2, rel=0.05)


@pytest.mark.parametrize("angle", [0.0, 0.6, -2.0, 3.0])
def test_a_pendulum_hangs_where_its_angle_says(angle: float) -> None:
    # its rod of 1 m turns about +y: a positive angle leads its lower end towards -x
    where = np.array((-0.5 * sin(angle), -0.5 * cos(angle)))  # x and z of the rod's middle

    view = CameraPose((0.0, 0.0, 0.0), distance=3.0, yaw=0.0, pitch=0.0, field_of_view=0.8)

    camera = Renderer(character("pendulum"), samples=1)
    mask = seen(take_picture(camera, np.array([angle]), view=view, size=SIZE))

    pixel = 2.0 * 3.0 * tan(0.4) / SIZE[1]
    column, row = 0.5 * np.array(SIZE) + where * (1.0, -1.0) / pixel
    np.testing.assert_allclose(centre(mask), (row, column), atol=1.0)


def test_a_turned_box_shows_its_other_face(camera: Renderer) -> None:
    quarter = np.array((0.0, 0.0, 0.0, 0.0, 0.0, 0.5 * pi))  # about z

    (_, left), (_, right) = box_of(seen(take_picture(camera, quarter, view=UPRIGHT, size=SIZE)))

    pixel = 2.0 * (3.0 - 0.5 * BOX[0]) * tan(0.3) / SIZE[1]
    assert right - left + 1 == pytest.approx(BOX[1] / pixel, abs=1.01)


def test_more_samples_a_pixel_smooth_the_edges_and_change_nothing_else(
    box: Character,
) -> None:
    turned = np.array((0.0, 0.0, 0.0, 0.0, 0.4, 0.0))
    pictures = []
    for samples in (1, 4):
        camera = Renderer(box, ground=False, samples=samples)
        pictures.append(take_picture(camera, turned, view=UPRIGHT, size=SIZE).astype(float))
    rough, smooth = pictures

    assert len(np.unique(smooth.reshape(-1, 3), axis=0)) > len(
        np.unique(rough.reshape(-1, 3), axis=0)
    )
    differs = (rough != smooth).any(axis=2)
    own = seen(rough.astype(np.uint8))
    inside = own[:-4, 2:-2] & own[4:, 2:-2] & own[2:-2, :-4] & own[2:-2, 4:]
    assert 0 < differs.sum() < 0.03 * differs.size
    assert not (differs[2:-2, 2:-2] & inside).any()


# Every character


@pytest.mark.slow
@pytest.mark.parametrize("name", EVERY_CHARACTER, ids=character_id)
def test_the_default_view_has_all_of_a_character_and_not_much_else(name: str) -> None:
    whole = character(name)
    rng = np.random.default_rng(3)
    positions = [np.array(whole.rest_position), *(random_state(whole, rng)[0] for _ in range(2))]

    camera = Renderer(whole, ground=False, samples=1)
    for position in positions:
        (top, left), (bottom, right) = box_of(seen(take_picture(camera, position, size=(160, 120))))

        assert min(top, left) > 0 and bottom < 119 and right < 159
        if name != "lift":  # whose rail is not seen, but where it begins is to be
            assert max((bottom - top) / 120.0, (right - left) / 160.0) > 0.4


def test_one_view_has_all_of_several_poses_each_in_its_turn() -> None:
    whole = character("humanoid")
    rng = np.random.default_rng(4)
    positions = np.array([random_state(whole, rng)[0] for _ in range(4)])
    positions[:, 0] += (0.0, 3.0, 6.0, 9.0)

    camera = Renderer(whole, ground=False, samples=1)
    view = view_of(camera, positions, size=SIZE)
    for position in positions:
        own = followed(camera, view, positions[0], position)
        mask = seen(take_picture(camera, position, view=own, size=SIZE))

        (top, left), (bottom, right) = box_of(mask)
        assert min(top, left) > 0 and bottom < SIZE[1] - 1 and right < SIZE[0] - 1
        assert own.distance == view.distance


def test_the_view_follows_the_root_along_the_ground_alone(camera: Renderer) -> None:
    view = followed(camera, UPRIGHT, at(1.0, 2.0, 3.0), at(1.5, 4.0, 9.0))

    assert view.target == (0.5, 2.0, 0.0)


@pytest.mark.slow
def test_the_view_of_an_arm_stays_where_it_is() -> None:
    arm = character("franka_panda")
    rest = np.array(arm.rest_position)

    camera = Renderer(arm, samples=1)
    assert followed(camera, UPRIGHT, rest, rest + 0.3) == UPRIGHT


def test_links_of_a_humanoid_have_different_colours() -> None:
    whole = character("humanoid")

    camera = Renderer(whole, ground=False, samples=1)
    picture = take_picture(camera, np.array(whole.rest_position), size=SIZE).astype(float)

    shown = picture[seen(picture.astype(np.uint8))]
    warm = shown[:, 0] > shown[:, 2] + 60.0
    cold = shown[:, 2] > shown[:, 0] + 60.0
    assert warm.sum() > 200 and cold.sum() > 200


# The ground


def test_a_character_above_the_ground_darkens_it_where_it_keeps_the_light_off(
    box: Character,
) -> None:
    view = CameraPose((0.0, 0.0, 0.0), distance=5.0, yaw=0.0, pitch=1.0, field_of_view=0.6)

    camera, alone = Renderer(box, samples=1), Renderer(box, ground=False, samples=1)
    low, high = (
        take_picture(camera, at(z=z), view=view, size=SIZE).astype(float).mean(axis=2)
        for z in (0.5, 100.0)
    )
    itself = seen(take_picture(alone, at(z=0.5), view=view, size=SIZE))

    darker = (high - low > 20.0) & ~itself
    assert 0.2 * itself.sum() < darker.sum() < 2.0 * itself.sum()
    np.testing.assert_allclose(low[~itself & ~darker], high[~itself & ~darker])


def test_the_ground_has_the_worlds_own_grid() -> None:
    whole = character("humanoid")
    rest = np.array(whole.rest_position)

    def picture(x: float) -> Picture:
        moved = rest.copy()
        moved[0] += x
        return take_picture(camera, moved, view=followed(camera, view, rest, moved), size=SIZE)

    camera = Renderer(whole, samples=1)
    view = view_of(camera, rest, size=SIZE)
    # tiles are of 1, 2 or 5 times a power of ten: at this distance 0.5 m
    assert 3.0 <= view.distance < 6.0
    start, two_tiles, one_tile = (picture(x).astype(int) for x in (0.0, 1.0, 0.5))

    changed = np.abs(two_tiles - start).max(axis=2) > 30
    assert changed.mean() < 0.01
    swapped = np.abs(one_tile - start).max(axis=2) > 30
    assert swapped.mean() > 0.2


def test_what_hangs_below_the_ground_is_not_hidden_by_it() -> None:
    view = CameraPose((0.0, 0.0, -0.5), distance=4.0, yaw=0.0, pitch=0.5)

    camera = Renderer(character("pendulum"))
    groundless = Renderer(character("pendulum"), ground=False)
    picture, alone = (
        take_picture(it, np.array([0.3]), view=view, size=SIZE) for it in (camera, groundless)
    )

    assert seen(alone).any()
    np.testing.assert_array_equal(picture, alone)


def test_a_terrain_is_drawn(box: Character, tmp_path: Path) -> None:
    path = tmp_path / "slab.urdf"
    path.write_text(
        '<robot name="slab"><link name="slab"><inertial><mass value="0"/>'
        '<inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial><collision>'
        '<origin xyz="0 0 -0.5"/><geometry><box size="20 20 0.2"/></geometry></collision>'
        "</link></robot>"
    )
    terrain = UrdfOptions(path, path.read_text(), fixed_base=True)

    bare = Renderer(box, ground=False, samples=1)
    with_terrain = Renderer(box, ground=False, terrain=terrain, samples=1)
    alone, on_slab = (
        seen(take_picture(it, STILL, view=UPRIGHT, size=SIZE)) for it in (bare, with_terrain)
    )

    assert on_slab.sum() > 1.2 * alone.sum()
    assert not (alone & ~on_slab).any()


# The ghost


def test_a_ghost_is_seen_where_it_is_and_what_is_behind_it_shines_through(camera: Renderer) -> None:
    def picture(ghost: FloatArray | None) -> Picture:
        return take_picture(camera, STILL, ghost=ghost, view=UPRIGHT, size=SIZE).astype(int)

    alone = picture(None)
    haunted = picture(at(x=0.2, y=-0.3))  # nearer than the box
    nearer = seen(take_picture(camera, at(x=0.2, y=-0.3), view=UPRIGHT, size=SIZE))

    changed = (haunted != alone).any(axis=2)
    np.testing.assert_array_equal(changed, nearer)
    own = seen(alone.astype(np.uint8))
    before_box, before_nothing = changed & own, changed & ~own
    for place in (before_box, before_nothing):
        assert (haunted[place][:, GHOST_GREEN] > haunted[place][:, 0]).all()
    # brighter where only the bright background is behind it
    assert haunted[before_nothing].mean() > haunted[before_box].mean() + 10.0


def test_a_ghost_behind_the_character_is_hidden(camera: Renderer) -> None:
    alone = take_picture(camera, STILL, view=UPRIGHT, size=SIZE)
    haunted = take_picture(camera, STILL, ghost=at(y=1.0), view=UPRIGHT, size=SIZE)

    np.testing.assert_array_equal(haunted, alone)


# Pictures as such


def test_a_picture_is_the_same_each_time_whatever_was_taken_before() -> None:
    whole = character("humanoid")
    rng = np.random.default_rng(5)
    positions = [random_state(whole, rng)[0] for _ in range(3)]

    def last_of(order: list[int]) -> bytes:
        camera = Renderer(whole)
        view = view_of(camera, positions[0], size=SIZE)
        for row in order:
            picture = take_picture(
                camera, positions[row], ghost=positions[row - 1], view=view, size=SIZE
            )
        return picture.tobytes()

    assert last_of([0]) == last_of([2, 1, 0]) == last_of([0])


def test_a_picture_is_bright_bytes_of_the_size_asked_for() -> None:
    camera = Renderer(character("humanoid"))
    picture = take_picture(camera, np.array(character("humanoid").rest_position), size=(90, 60))

    assert picture.shape == (60, 90, 3) and picture.dtype == np.uint8
    assert picture.mean() > 150.0


def test_a_terrain_that_cannot_be_read_is_one_line_about_its_file(
    box: Character, tmp_path: Path
) -> None:
    mesh = '<collision><geometry><mesh filename="none.obj"/></geometry></collision>'
    nowhere = UrdfOptions(
        tmp_path / "x.urdf", f'<robot name="x"><link name="a">{mesh}</link></robot>'
    )

    with pytest.raises(CharacterError, match=r"x\.urdf.*none\.obj") as error:
        Renderer(box, terrain=nowhere)
    assert "\n" not in str(error.value)


def test_pictures_need_no_engine() -> None:
    program = (
        "import sys, actuated_characters.render.engine.renderer\n"
        "print([name for name in sys.modules if name.startswith(('pybullet', 'sim_node'))])"
    )

    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)

    assert (done.stdout.strip(), done.returncode) == ("[]", 0), done.stderr


def test_a_character_that_is_nowhere_leaves_the_ground_as_it_is(box: Character) -> None:
    size, nowhere = (64, 48), STILL * np.nan
    above = CameraPose((0.0, 0.0, 0.5), distance=4.0)

    picture = take_picture(Renderer(box), nowhere, ghost=nowhere, view=above, size=size)

    far_away = take_picture(Renderer(box), at(z=1e4), view=above, size=size)
    np.testing.assert_array_equal(picture, far_away)


@pytest.mark.parametrize("size", [(1, 1), (1, 300), (300, 1), (17, 31)])
def test_a_picture_has_any_size(box: Character, size: tuple[int, int]) -> None:
    picture = take_picture(Renderer(box), at(z=0.4), ghost=at(x=0.3), view=UPRIGHT, size=size)

    assert picture.shape == (size[1], size[0], 3)


def test_half_a_million_triangles_are_drawn_in_a_second(tmp_path: Path) -> None:
    side = np.linspace(-1.0, 1.0, 501)
    x, y = np.meshgrid(side, side)
    vertices = np.column_stack((x.ravel(), np.sin(9.0 * x * y).ravel(), y.ravel()))
    row, column = np.mgrid[:500, :500].reshape(2, -1)
    first = 501 * row + column
    halves = [(first, first + 1, first + 502), (first, first + 502, first + 501)]
    corners = vertices[np.concatenate([np.column_stack(half) for half in halves])]
    stl = np.zeros(len(corners), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("", "<u2")])
    stl["corners"] = corners
    (tmp_path / "waves.stl").write_bytes(bytes(80) + len(stl).to_bytes(4, "little") + stl.tobytes())
    path = tmp_path / "waves.urdf"
    path.write_text(
        '<robot name="waves"><link name="waves"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial><visual><geometry>'
        '<mesh filename="waves.stl"/></geometry></visual></link></robot>'
    )
    camera = Renderer(load_character(str(path)), ground=False)
    take_picture(camera, STILL, view=UPRIGHT, size=SIZE)  # compiled by now

    start = time.process_time()
    picture = take_picture(camera, STILL, view=UPRIGHT, size=SIZE)

    assert time.process_time() - start < 1.0
    assert seen(picture).mean() > 0.3
