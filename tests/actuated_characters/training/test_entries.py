"""How motions begin after other clips and after falls: as a behaviour goes over to them."""

import numpy as np
import pytest

from actuated_characters.training.entries import FALL, Entries
from actuated_characters.training.exercises import Exercise
from actuated_characters.training.job import make_job
from actuated_characters.training.references import TrainedReference
from controller_node.references.base import ReferenceState
from controller_node.references.clip import ClipReference
from controller_node.references.posture import Posture
from msgs_config.clips.reading import read_clip
from msgs_config.errors import ActuatedCharactersError
from msgs_config.geometry import rotations
from tests.support.physics import character

HUMANOID = character("humanoid")
LAYOUT = HUMANOID.layout
RATE = 240
POSTURE = Posture(HUMANOID)


def entries(clip: str, after: str, seed: int = 0) -> list[TrainedReference]:
    exercise = Exercise("humanoid", clip)
    plan, _ = exercise.plan(1.0, {}, {"planner": "predictive", "plan.workers": 1}, 0)
    return Entries(exercise, plan, seed).after(after)


def last_of(clip: str) -> ReferenceState:
    frames = read_clip(HUMANOID, clip)
    return ClipReference(LAYOUT, frames).sample(float(frames.times[-1]))


def begins(entry: TrainedReference) -> ReferenceState:
    return entry.reference.desired_at(0)


def pose(state: ReferenceState) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """All but place and heading."""
    upright = rotations.multiply(
        rotations.about_z(-float(POSTURE.heading(state.configuration.orientations_xyzw[0]))),
        state.configuration.orientations_xyzw[0],
    )
    position = state.configuration.position
    return np.concatenate((position[2:3], rotations.log(upright), position[6:]))


def test_after_a_clip_it_begins_as_that_ends_at_moments_of_all_of_the_motion() -> None:
    end, walk = last_of("getup_faceup"), ClipReference(LAYOUT, read_clip(HUMANOID, "walk"))
    found = entries("walk", "getup_faceup")

    phases = []
    for entry in found:
        np.testing.assert_allclose(
            begins(entry).configuration.position, end.configuration.position, atol=1e-9
        )
        np.testing.assert_allclose(begins(entry).velocity, end.velocity, atol=1e-9)
        then = entry.reference.desired_at(round(entry.cycle_s * RATE) + 1)
        offs = [
            np.abs(pose(walk.sample(tick / RATE)) - pose(then)).max()
            for tick in range(round(1.27 * RATE))
        ]
        assert min(offs) < 0.05  # rad: it is a moment of the walk
        phases.append(int(np.argmin(offs)))
    assert len({phase // 30 for phase in phases}) > 6  # eighths of a second
    assert sum(entry.weight for entry in found) == pytest.approx(1.0)


@pytest.mark.slow
@pytest.mark.parametrize("clip", ["getup_faceup", "getup_facedown"])
def test_after_a_fall_it_lies_and_gets_up_from_the_side_on_which_it_lies(clip: str) -> None:
    found = entries(clip, FALL)

    end, faces_up = last_of(clip), clip == "getup_faceup"
    poses = set()
    for entry in found:
        lies = begins(entry).configuration
        assert lies.position[2] < 0.45
        assert POSTURE.faces_up(lies.orientations_xyzw[0]) == faces_up
        poses.add(round(float(lies.position[9]), 2))
        over = entry.reference.desired_at(round(entry.lasts_s * RATE))
        np.testing.assert_allclose(pose(over), pose(end), atol=0.1)
    assert len(poses) > len(found) / 2  # they do not lie alike


@pytest.mark.nightly
def test_the_same_seed_has_the_same_falls() -> None:
    first, again, other = (entries("getup_faceup", FALL, seed) for seed in (1, 1, 2))

    def bits(found: list[TrainedReference]) -> list[bytes]:
        return [begins(entry).configuration.position.tobytes() for entry in found]

    assert bits(first) == bits(again) != bits(other)


def test_half_of_the_episodes_begin_in_the_motion_itself() -> None:
    job = make_job([Exercise("humanoid", "walk")], {}, decisions=10, after=["getup_faceup"])

    own, *others = job.references
    assert own.weight == pytest.approx(sum(each.weight for each in others))
    assert own.wraps and not any(each.wraps for each in others)


@pytest.mark.parametrize(
    ("clip", "after", "reason"),
    [
        ("walk", "nobody", "nobody"),
        ("backflip", "fall", "backflip begins standing"),
    ],
)
def test_what_cannot_come_before_is_one_line(clip: str, after: str, reason: str) -> None:
    with pytest.raises(ActuatedCharactersError) as caught:
        make_job([Exercise("humanoid", clip)], {}, decisions=10, after=[after])

    assert reason in str(caught.value) and "\n" not in str(caught.value)
