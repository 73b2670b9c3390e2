"""Clips cut, mirrored, joined, looped and played faster."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from character_motion.clips.editing import blend, change_speed, loop, mirror, trim
from character_motion.clips.motion_clip import MotionClip, read_motion_clip
from controller_node.references.clip import ClipReference
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.clips.reading import ClipFrames
from msgs_config.errors import ClipError
from tests.support.physics import character


def clip_of(name: str) -> MotionClip:
    return read_motion_clip(character("humanoid"), name)


def link_places(clip: MotionClip) -> dict[str, FloatArray]:
    """Origins (f, 3) of the links, by name."""
    model, layout = DynamicsModel(clip.character), clip.character.layout
    frames = ClipFrames(
        clip.times,
        clip.motion.position,
        clip.motion.orientations_xyzw,
        False,
        clip.character.position_bounds(),
        (),
    )
    reference, places = ClipReference(layout, frames), []
    for time in clip.times[:-1].tolist():
        model.update(reference.sample(time).configuration.position, np.zeros(layout.size))
        places.append(model.link_poses()[0])
    return {link.name: np.array(places)[:, row] for row, link in enumerate(clip.character.links)}


def test_a_part_begins_at_zero_with_its_contacts() -> None:
    walk = replace(clip_of("walk"), contacts={"left_toe": ((0.0, 0.5), (0.8, 1.2))})

    part = trim(walk, 0.2, 0.9)

    rows = (walk.times >= 0.2 - 1e-9) & (walk.times <= 0.9 + 1e-9)
    np.testing.assert_array_equal(part.motion.position, walk.motion.position[rows])
    assert part.times[0] == 0.0 and not part.wraps
    start = float(walk.times[rows][0])
    np.testing.assert_allclose(part.contacts["left_toe"][0], (0.0, 0.5 - start))
    assert part.source["edits"] == ["trimmed to 0.2 s to 0.9 s"] and part.quality == {}


def test_a_faster_clip_has_the_same_poses_sooner() -> None:
    run = replace(clip_of("run"), contacts={"left_toe": ((0.1, 0.2),)})

    fast = change_speed(run, 2.0)

    np.testing.assert_allclose(fast.times, run.times / 2.0)
    assert fast.motion is run.motion and fast.contacts["left_toe"] == ((0.05, 0.1),)


def test_a_mirrored_body_is_where_its_image_is() -> None:
    kick = replace(clip_of("kick"), contacts={"left_toe": ((0.1, 0.2),)})

    image = mirror(kick)

    places, images = link_places(kick), link_places(image)
    for name, place in places.items():
        other = name.replace("left", "?").replace("right", "left").replace("?", "right")
        np.testing.assert_allclose(images[other], place * (1.0, -1.0, 1.0), atol=1e-9)
    assert image.contacts == {"right_toe": ((0.1, 0.2),)}


def test_an_image_of_an_image_is_the_clip() -> None:
    spin = clip_of("spin")

    again = mirror(mirror(spin))

    apart = spin.character.layout.difference(spin.motion, again.motion)
    np.testing.assert_allclose(apart, 0.0, atol=1e-9)


def test_a_cycle_is_found_and_closed() -> None:
    walk = clip_of("walk")
    whole = blend(walk, walk, 0.2)  # two steps of each foot and more

    cycle = loop(whole)

    assert cycle.wraps and 0.9 < cycle.duration < 1.4  # the walk's own cycle is 1.27 s
    layout = walk.character.layout
    ends = [
        GeneralizedPosition(cycle.motion.position[row], cycle.motion.orientations_xyzw[row])
        for row in (0, -1)
    ]
    gap = layout.difference(ends[0], ends[1])
    np.testing.assert_allclose(gap[2], 0.0, atol=1e-6)
    np.testing.assert_allclose(gap[6:], 0.0, atol=1e-6)
    assert cycle.motion.position[-1, 0] - cycle.motion.position[0, 0] > 0.8  # it goes ahead


def test_times_of_a_cycle_can_be_given() -> None:
    cycle = loop(clip_of("dance_a"), 0.4, 1.2)

    assert cycle.duration == pytest.approx(0.8, abs=0.05)


def test_a_clip_goes_on_as_another_one() -> None:
    walk, run = clip_of("walk"), clip_of("run")

    both = blend(walk, run, 0.3)

    layout = walk.character.layout
    assert both.duration == pytest.approx(walk.duration + run.duration - 0.3, abs=0.04)
    before = int(0.9 * (walk.duration - 0.3) * walk.rate)
    apart = layout.difference(
        GeneralizedPosition(walk.motion.position[:before], walk.motion.orientations_xyzw[:before]),
        GeneralizedPosition(both.motion.position[:before], both.motion.orientations_xyzw[:before]),
    )
    np.testing.assert_allclose(apart, 0.0, atol=1e-6)
    steps = np.linalg.norm(np.diff(both.motion.position[:, :2], axis=0), axis=1)
    assert steps.max() < 0.2 and both.motion.position[-1, 0] > 2.5  # m: no jump, and it went on


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda clip: trim(clip, 5.0), "from 5 s to 1.2.* there are 0 frames"),
        (lambda clip: trim(clip, 0.5, 0.4), "from 0.5 s to 0.4 s there are 0 frames"),
        (lambda clip: change_speed(clip, 0.0), "speed 0; it must be 0.05 to 20"),
        (lambda clip: change_speed(clip, float("nan")), "speed nan; it must be"),
        (
            lambda clip: blend(clip, clip, 9.0),
            "blended over 9 s; it must be over 0 and at most 1.2",
        ),
        (lambda clip: blend(clip, clip, 0.0), "blended over 0 s"),
        (lambda clip: loop(clip, 0.0, 0.1), "no cycle of 0.2 s or more"),
        (lambda clip: mirror(read_motion_clip(character("laikago"), LAIKAGO)), "'laikago' is not"),
    ],
)
def test_what_cannot_be_is_one_clear_line(
    edit: Callable[[MotionClip], MotionClip], message: str
) -> None:
    with pytest.raises(ClipError, match=message) as caught:
        edit(clip_of("walk"))

    assert "\n" not in str(caught.value)


LAIKAGO = "walk"


@pytest.mark.parametrize(
    ("start", "end", "message"),
    [
        (1.0, 4.0, r"4 s is not within the clip, which lasts 1\.\d+ s, and begins again there"),
        (-0.1, 1.0, "-0.1 s is not within"),
        (float("nan"), 1.0, "nan s"),
        (0.2, float("inf"), "inf s is not within"),
        (0.8, 0.3, "two or more|no cycle"),
        (0.3, 0.3, "two or more|no cycle"),
    ],
)
@pytest.mark.parametrize("edit", [trim, loop])
def test_times_outside_of_a_clip_are_refused(
    edit: Callable[[MotionClip, float, float], MotionClip], start: float, end: float, message: str
) -> None:
    with pytest.raises(ClipError, match=message):
        edit(clip_of("walk"), start, end)


def test_a_duration_as_it_is_printed_is_the_clip_s_end() -> None:
    walk = clip_of("walk")

    assert trim(walk, 0.0, float(f"{walk.duration:.3g}")).times[-1] == walk.times[-1]
