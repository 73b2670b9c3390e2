"""The fewest keys of a clip, and what is to be said of them."""

from dataclasses import dataclass

import numpy as np

from actuated_characters.keys.fewest import fewest_keys
from actuated_characters.keys.samples import Samples, Tolerances, half_frames, spatial_difference
from actuated_characters.keys.thinning import Progress
from actuated_characters.keys.written import FewestKeys
from character_motion.clips.motion_clip import MotionClip
from msgs_config.arrays import BoolArray
from msgs_config.character.layout import JointLayout


@dataclass(frozen=True)
class Deviation:
    """The largest deviation of one kind."""

    size: float  # rad or m
    joint: str
    time: float  # s


@dataclass(frozen=True)
class KeyedClip:
    """A clip, its keys, and how far their path is from its frames and the moments between them."""

    clip: MotionClip
    found: FewestKeys
    angle: Deviation | None  # None where no joint turns
    place: Deviation | None  # None where nothing is measured in m

    @property
    def share(self) -> float:
        """Keys for each frame."""
        return len(self.found.keyframes.times) / len(self.clip.times)

    @property
    def numbers(self) -> float:
        """Values, velocities and accelerations of all keys for each number of the frames."""
        keyframes = self.found.keyframes
        rates = (keyframes.velocities, keyframes.accelerations)
        own = sum(int((~np.isnan(each)).sum()) for each in rates if each is not None)
        return (keyframes.configurations.position.size + own) / self.clip.motion.position.size


def keys_of_clip(
    clip: MotionClip, tolerances: Tolerances, progress: Progress = lambda share: None
) -> KeyedClip:
    """The fewest keys of a clip; a loop of one that goes on from its end where it began."""
    layout = clip.character.layout
    samples = half_frames(layout, clip.times, clip.motion)
    found = fewest_keys(
        layout,
        samples,
        tolerances,
        bounds=clip.character.position_bounds(),
        loops=clip.wraps and _is_closed(layout, samples, tolerances),
        progress=progress,
    )
    turns = _turning_vectors(layout)
    return KeyedClip(
        clip,
        found,
        _largest(layout, samples, found, turns),
        _largest(layout, samples, found, ~turns),
    )


def _is_closed(layout: JointLayout, samples: Samples, tolerances: Tolerances) -> bool:
    """Whether the last frame is the first one again, within the tolerances."""
    first, last = samples[:1].configurations, samples[-1:].configurations
    gap = layout.norms(spatial_difference(layout, first, last)[0])
    return bool((gap <= tolerances.of_vectors(layout)).all())


def _turning_vectors(layout: JointLayout) -> BoolArray:
    """Whether each physical vector (b,) is an angle or a rotation."""
    marks = Tolerances(angle=2.0, place=1.0).of_vectors(layout)
    return marks > 1.5


def _largest(
    layout: JointLayout, samples: Samples, found: FewestKeys, vectors: BoolArray
) -> Deviation | None:
    chosen = np.flatnonzero(vectors)
    if not len(chosen):
        return None
    deviations = found.deviations[:, chosen]
    row, column = np.unravel_index(int(deviations.argmax()), deviations.shape)
    start = layout.vector_starts[chosen[column]]
    joint = next(j for j in layout.joints if j.start <= start < j.entries.stop)
    return Deviation(float(deviations[row, column]), joint.name, float(samples.times[row]))
