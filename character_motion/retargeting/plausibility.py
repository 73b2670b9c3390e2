"""What speaks against a capture: a body that is no human one, and feet that float.

Proportions are those of people (Winter 2009, "Biomechanics and Motor Control of Human Movement",
figure 4.1), and as much beyond as makers' skeletons and drawn figures are.
"""

import re

import numpy as np

from character_motion.retargeting.captured_body import CapturedBody
from character_motion.retargeting.contacts import ground_height
from character_motion.retargeting.conventions import rest_up
from character_motion.retargeting.skeleton_map import SIDES
from msgs_config.arrays import FloatArray

_SHARES = {  # shares of a leg's length from hip to ankle
    "the shank": (0.40, 0.62),
    "an arm from shoulder to wrist": (0.45, 0.85),
    "the trunk from hips to neck": (0.38, 0.95),
    "the distance of the hips": (0.06, 0.42),
}
_MOST_DOUBTS = 1  # doubts that a human body may give rise to
_ANIMAL = re.compile(r"(?<!pony)(?<!coat)tail|paw(?!n)|hoof|wing|snout|hind|fetlock", re.IGNORECASE)
_LIES = 0.5  # cosine of the trunk's angle to the vertical, below which it lies
_SHARE_OF_FRAMES = 0.8  # share of the frames
_MAX_FLIGHT = 1.0  # s that a jump lasts
_SMOOTHING_TIME = 0.2  # s over which the ground is smoothed
_FLOATS = 0.05  # m over the ground


def doubts_of_human(body: CapturedBody) -> tuple[str, ...]:
    """What speaks against a body being human, a phrase each; empty of a human one.

    The body's world is z up; its unit of length does not matter.
    """
    animal = [name for name in body.names if _ANIMAL.search(name)]
    found = [f"a joint is called '{animal[0]}'"] if animal else []
    unusual = []
    for what, share in _shares(body).items():
        low, high = _SHARES[what]
        if not low <= share <= high:
            unusual.append(f"{what} is {share:.2f} of a leg, of people {low:g} to {high:g}")
    trunk = body.neck_base() - body.middle("hip")
    upright = trunk[:, 2] / np.maximum(np.linalg.norm(trunk, axis=-1), 1e-9)
    lies = float((upright < _LIES).mean())
    if lies > _SHARE_OF_FRAMES and rest_up(body) is None:
        unusual.append(f"the trunk lies in {100 * lies:.0f} % of the frames, at rest as well")
    if animal or len(unusual) > _MOST_DOUBTS:
        found += unusual
    return tuple(found)


def _shares(body: CapturedBody) -> dict[str, float]:
    leg = body.leg_length
    trunk = np.linalg.norm(body.neck_base() - body.middle("hip"), axis=-1)
    hips = np.linalg.norm(body.part(f"{SIDES[0]}_hip") - body.part(f"{SIDES[1]}_hip"), axis=-1)
    lengths = {
        "the shank": body.length(("knee", "ankle")),
        "the trunk from hips to neck": float(np.median(trunk)),
        "the distance of the hips": float(np.median(hips)),
    }
    if all(f"{side}_wrist" in body.map for side in SIDES):
        arm = body.length(("shoulder", "elbow")) + body.length(("elbow", "wrist"))
        lengths["an arm from shoulder to wrist"] = arm
    return {what: length / leg for what, length in lengths.items()}


def ground_drift(body: CapturedBody) -> FloatArray:
    """How far (f,) the ground on which a body goes about is over where it is at most times, m.

    It is the height of the lower foot without what rises from it for less than a second, as a jump
    does (an opening: Serra 1982, "Image Analysis and Mathematical Morphology"), smoothed a little.
    """
    feet = [
        body.part(f"{side}_{part}")[:, 2]
        for side in SIDES
        for part in ("ankle", "toe")
        if f"{side}_{part}" in body.map
    ]
    lowest = np.min(feet, axis=0)
    half_flight = max(1, round(0.5 * _MAX_FLIGHT / body.frame_time))
    opened = _over(_over(lowest, half_flight).min(axis=-1), half_flight).max(axis=-1)
    smoothed = _over(opened, max(1, round(0.5 * _SMOOTHING_TIME / body.frame_time))).mean(axis=-1)
    drift: FloatArray = smoothed - ground_height(lowest)
    return drift


def describe_floating(body: CapturedBody) -> str:
    """A remark on feet that float over the ground; empty if they do not. m, z up."""
    drift = ground_drift(body)
    share = float((drift > _FLOATS).mean())
    if not share > 0.0:
        return ""
    return (
        f"the feet float by up to {drift.max():.2f} m, for {100 * share:.0f} % of the time by more "
        f"than {_FLOATS:g} m; --ground puts them on the ground"
    )


def _over(values: FloatArray, reach: int) -> FloatArray:
    """Values (f,) around each frame (f, 2 reach + 1)."""
    padded = np.pad(values, reach, mode="edge")
    windows: FloatArray = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)
    return windows
