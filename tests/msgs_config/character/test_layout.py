"""The layout gives every degree of freedom its entry, and rotations their own arithmetic."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import ROOT, JointLayout, JointType
from msgs_config.errors import LayoutError
from msgs_config.geometry import rotations

PROPERTY = settings(max_examples=60, deadline=None)
SEEDS = st.integers(0, 2**32 - 1)

# A character with one joint of each type; the entries in the order of the design's table.
FIGURE = [
    ("root", JointType.FLOATING),
    ("slider", JointType.PRISMATIC),
    ("skull", JointType.FIXED),
    ("chest", JointType.SPHERICAL),
    ("right_knee", JointType.REVOLUTE),
]
FIGURE_DOFS = [
    *("root_x", "root_y", "root_z", "root_rx", "root_ry", "root_rz"),
    "slider",
    *("chest_x", "chest_y", "chest_z"),
    "right_knee",
]


@dataclass(frozen=True)
class Expected:
    """What one joint must add to a layout."""

    suffixes: tuple[str, ...]
    rotation: tuple[int, int] | None
    vectors: list[tuple[int, int]]


EXPECTED = {
    JointType.REVOLUTE: Expected(("",), None, [(0, 1)]),
    JointType.PRISMATIC: Expected(("",), None, [(0, 1)]),
    JointType.SPHERICAL: Expected(("_x", "_y", "_z"), (0, 3), [(0, 3)]),
    JointType.FLOATING: Expected(("_x", "_y", "_z", "_rx", "_ry", "_rz"), (3, 6), [(0, 3), (3, 6)]),
}


@pytest.fixture
def figure() -> JointLayout:
    return JointLayout(FIGURE)


@st.composite
def layouts(draw: st.DrawFn, joints_at_least: int = 0) -> JointLayout:
    """Characters of up to six joints, some with a floating base."""
    kinds = [kind for kind in JointType if kind is not JointType.FLOATING]
    drawn = draw(st.lists(st.sampled_from(kinds), min_size=joints_at_least, max_size=6))
    base = [(ROOT, JointType.FLOATING)] if draw(st.booleans()) else []
    return JointLayout(base + [(f"joint{index}", kind) for index, kind in enumerate(drawn)])


def moving_layouts() -> st.SearchStrategy[JointLayout]:
    return layouts(joints_at_least=1).filter(lambda layout: layout.size > 0)


def random_position(layout: JointLayout, rng: np.random.Generator) -> FloatArray:
    """A position whose rotation vectors have any direction and a norm of at most pi."""
    position = rng.normal(size=layout.size)
    for row in layout.rotation_entries:
        position[row] *= rng.uniform(0.0, np.pi) / np.linalg.norm(position[row])
    return position


# Names and slices


@pytest.mark.parametrize("kind", EXPECTED)
def test_a_joint_owns_the_entries_of_its_type(kind: JointType) -> None:
    expected = EXPECTED[kind]
    start = 1

    layout = JointLayout([("before", JointType.REVOLUTE), ("hip", kind)])

    joint = layout.joint("hip")
    end = start + len(expected.suffixes)
    assert joint.entries == slice(start, end)
    assert joint.dof_names == tuple("hip" + suffix for suffix in expected.suffixes)
    assert layout.dof_names == ("before", *joint.dof_names)
    assert layout.size == end
    assert joint.vectors == tuple(slice(start + a, start + b) for a, b in expected.vectors)
    if expected.rotation is None:
        assert joint.rotation is None
    else:
        assert joint.rotation == slice(start + expected.rotation[0], start + expected.rotation[1])


def test_the_entries_are_those_of_the_design(figure: JointLayout) -> None:
    assert list(figure.dof_names) == FIGURE_DOFS
    assert figure.size == 11
    np.testing.assert_array_equal(figure.rotation_entries, [[3, 4, 5], [7, 8, 9]])
    np.testing.assert_array_equal(figure.vector_starts, [0, 3, 6, 7, 10])
    np.testing.assert_array_equal(figure.vector_lengths, [3, 3, 1, 3, 1])


def test_a_fixed_joint_has_no_place_in_the_layout(figure: JointLayout) -> None:
    assert figure.joint_names == ["root", "slider", "chest", "right_knee"]
    with pytest.raises(LayoutError, match=r"'skull'.*: root, slider, chest, right_knee"):
        figure.joint("skull")


@PROPERTY
@given(layouts())
def test_the_joints_lie_side_by_side_without_gaps(layout: JointLayout) -> None:
    end = 0
    for joint in layout.joints:
        assert joint.entries.start == end
        assert joint.dof_names == layout.dof_names[joint.entries]
        end = joint.entries.stop
    assert end == layout.size == len(layout.dof_names)
    assert layout.vector_lengths.sum() == layout.size


def test_only_a_floating_base_has_no_motor(figure: JointLayout) -> None:
    fixed = JointLayout(FIGURE[1:])

    assert figure.has_floating_base
    assert figure.actuated_joint_names == ["slider", "chest", "right_knee"]
    assert not fixed.has_floating_base
    assert fixed.actuated_joint_names == ["slider", "chest", "right_knee"]


@pytest.mark.parametrize(
    "joints",
    [
        [("hip", JointType.REVOLUTE), ("hip", JointType.SPHERICAL)],
        [("hip", JointType.REVOLUTE), ("hip", JointType.PRISMATIC)],
        [("hip", JointType.SPHERICAL), ("hip_y", JointType.REVOLUTE)],
    ],
)
def test_two_entries_of_one_name_are_refused(joints: list[tuple[str, JointType]]) -> None:
    with pytest.raises(LayoutError, match="same name"):
        JointLayout(joints)


def test_a_layout_may_be_empty() -> None:
    layout = JointLayout([("base", JointType.FIXED)])
    nothing = np.zeros(0)

    configuration = layout.configuration(nothing)

    assert layout.size == 0
    assert layout.difference(configuration, configuration).shape == (0,)
    assert layout.norms(nothing).shape == (0,)
    assert layout.clipped(nothing, nothing).shape == (0,)


# Masks and indices


def test_a_mask_marks_the_entries_of_the_joints_named(figure: JointLayout) -> None:
    mask = figure.mask(["chest", "slider"])

    assert mask.dtype == np.bool_
    marked = [name for name, is_marked in zip(FIGURE_DOFS, mask, strict=True) if is_marked]
    assert marked == ["slider", "chest_x", "chest_y", "chest_z"]
    assert not figure.mask([]).any()
    with pytest.raises(LayoutError, match="'tail'"):
        figure.mask(["chest", "tail"])


@PROPERTY
@given(layouts(), st.data())
def test_indices_follow_the_order_of_the_names(layout: JointLayout, data: st.DataObject) -> None:
    chosen = [joint for joint in layout.joints if data.draw(st.booleans())]
    entries = [name for joint in chosen for name in joint.dof_names]
    names = tuple(data.draw(st.permutations(entries)))

    indices = layout.indices(names)

    assert tuple(layout.dof_names[index] for index in indices) == names


@pytest.mark.parametrize(
    ("names", "line"),
    [
        (("slider", "chest"), f"unknown degree of freedom 'chest'; .*{', '.join(FIGURE_DOFS)}"),
        (("slider", "right_knee", "right_knee"), "'right_knee' is named twice"),
        (("chest_x", "slider", "chest_z"), "'chest' comes in parts: 'chest_y' is missing"),
        (("chest_z",), "'chest' comes in parts: 'chest_x' is missing"),
        (("root_x", "root_y", "root_z"), "'root' comes in parts: 'root_rx' is missing"),
    ],
)
def test_names_that_do_not_fit_are_refused_each_time(
    figure: JointLayout, names: tuple[str, ...], line: str
) -> None:
    for _ in range(2):
        with pytest.raises(LayoutError, match=line):
            figure.indices(names)


# Differences


@PROPERTY
@given(layouts(), SEEDS)
def test_the_difference_leads_from_the_start_to_the_end(layout: JointLayout, seed: int) -> None:
    rng = np.random.default_rng(seed)
    start, end = random_position(layout, rng), random_position(layout, rng)
    is_rotation = np.zeros(layout.size, dtype=bool)
    is_rotation[layout.rotation_entries] = True
    a, b = layout.configuration(start), layout.configuration(end)

    difference = layout.difference(a, b)

    np.testing.assert_allclose(layout.difference(a, a), np.zeros(layout.size), atol=1e-15)
    np.testing.assert_allclose(layout.difference(b, a), -difference, atol=1e-13)
    np.testing.assert_allclose((start + difference)[~is_rotation], end[~is_rotation], atol=1e-14)
    for row in layout.rotation_entries:
        turn, from_, to = (
            rotations.matrix(rotations.exp(part[row])) for part in (difference, start, end)
        )
        np.testing.assert_allclose(from_ @ turn, to, atol=1e-13)  # in the start's child frame
        assert np.linalg.norm(difference[row]) <= np.pi * (1.0 + 1e-15)


def test_rotations_take_the_short_way_past_half_a_turn_and_hinges_count_every_turn(
    figure: JointLayout,
) -> None:
    start, end = np.zeros(figure.size), np.zeros(figure.size)
    start[9], end[9] = 3.1, -3.1  # chest_z
    end[10] = 7.0  # right_knee

    difference = figure.difference(figure.configuration(start), figure.configuration(end))

    assert difference[9] == pytest.approx(2.0 * np.pi - 6.2)
    assert difference[10] == 7.0


@pytest.mark.parametrize("shape", [(4,), (2, 3), (0,)])
def test_a_batch_of_positions_is_treated_as_each_of_them(
    figure: JointLayout, shape: tuple[int, ...]
) -> None:
    rng = np.random.default_rng(11)
    starts, ends = rng.uniform(-1.5, 1.5, size=(2, *shape, figure.size))

    differences = figure.difference(figure.configuration(starts), figure.configuration(ends))
    norms = figure.norms(starts)

    assert differences.shape == (*shape, figure.size)
    assert norms.shape == (*shape, 5)
    for index in np.ndindex(shape):
        start, end = figure.configuration(starts[index]), figure.configuration(ends[index])
        np.testing.assert_allclose(differences[index], figure.difference(start, end), atol=1e-14)
        np.testing.assert_allclose(norms[index], figure.norms(starts[index]), rtol=1e-14)


def test_a_difference_leaves_both_configurations_as_they_were(figure: JointLayout) -> None:
    rng = np.random.default_rng(3)
    a, b = random_position(figure, rng), random_position(figure, rng)
    a_before, b_before = a.copy(), b.copy()

    figure.difference(figure.configuration(a), figure.configuration(b))

    np.testing.assert_array_equal(a, a_before)
    np.testing.assert_array_equal(b, b_before)


# Norms and limits


def test_the_norm_of_each_vector_is_its_euclidean_length(figure: JointLayout) -> None:
    entries = np.array([3.0, 4.0, 0.0, 0.0, -5.0, 12.0, -2.0, 2.0, -3.0, 6.0, 8.0])

    np.testing.assert_allclose(figure.norms(entries), [5.0, 13.0, 2.0, 7.0, 8.0], rtol=1e-15)


@PROPERTY
@given(moving_layouts(), SEEDS, st.sampled_from([1e-3, 1.0, 1e3, 1e6]))
def test_clipping_shortens_what_is_too_long_and_turns_nothing(
    layout: JointLayout, seed: int, scale: float
) -> None:
    rng = np.random.default_rng(seed)
    effort = scale * rng.normal(size=layout.size)
    limits = scale * rng.uniform(0.0, 3.0, size=len(layout.vector_starts))
    limits[rng.random(len(limits)) < 0.2] = np.inf
    limits[rng.random(len(limits)) < 0.2] = 0.0
    before = effort.copy()

    clipped = layout.clipped(effort, limits)

    np.testing.assert_array_equal(effort, before)
    vectors = [part for joint in layout.joints for part in joint.vectors]
    for part, limit in zip(vectors, limits, strict=True):
        given_norm = float(np.linalg.norm(effort[part]))
        if given_norm <= limit:  # to the bit
            np.testing.assert_array_equal(clipped[part], effort[part])
        else:
            expected = effort[part] / given_norm * limit
            np.testing.assert_allclose(clipped[part], expected, rtol=1e-14)
            assert np.linalg.norm(clipped[part]) <= limit * (1.0 + 1e-15)
    np.testing.assert_array_equal(layout.clipped(effort, layout.norms(effort)), effort)


def test_the_force_and_the_torque_of_the_base_have_limits_of_their_own(figure: JointLayout) -> None:
    effort = np.zeros(figure.size)
    effort[:6] = [300.0, 0.0, 400.0, 0.0, 0.0, 50.0]
    limits = np.array([100.0, 200.0, 1.0, 1.0, 1.0])

    clipped = figure.clipped(effort, limits)

    np.testing.assert_allclose(clipped[:6], [60.0, 0.0, 80.0, 0.0, 0.0, 50.0], rtol=1e-15)


def test_clipping_one_joint_while_another_is_at_rest_raises_no_floating_point_fault(
    figure: JointLayout,
) -> None:
    effort = np.zeros(figure.size)
    effort[10] = 1000.0  # right_knee; all others rest
    limits = np.array([np.inf, np.inf, 100.0, 200.0, 150.0])

    with np.errstate(divide="raise", invalid="raise", over="raise"):
        clipped = figure.clipped(effort, limits)

    assert clipped[10] == pytest.approx(150.0)
    np.testing.assert_array_equal(clipped[:10], np.zeros(10))


@pytest.mark.parametrize("size", [1e160, 1e300])
def test_an_effort_too_large_to_be_squared_is_clipped_to_its_limit(
    figure: JointLayout, size: float
) -> None:
    effort = np.zeros(figure.size)
    effort[7:10] = [3.0 * size, 0.0, -4.0 * size]  # chest
    effort[6] = 2.0 * size  # slider, without a limit
    limits = np.array([np.inf, np.inf, np.inf, 200.0, 150.0])

    with np.errstate(over="ignore"):
        clipped = figure.clipped(effort, limits)

    np.testing.assert_allclose(clipped[7:10], [120.0, 0.0, -160.0], rtol=1e-14)
    assert clipped[6] == effort[6]
