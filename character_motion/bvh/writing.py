"""Writer of BVH files."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from character_motion.bvh.skeleton import BvhMotion, Skeleton
from msgs_config.whole_files import write_whole

_INDENT = "  "
_DECIMALS = 6  # micrometres, where the unit is a metre, and millionths of a degree


def write_bvh(path: Path, motion: BvhMotion) -> None:
    """Write a BVH file, whole or not at all. Raises RecordingError if it cannot be written."""
    write_whole(path, bvh_text(motion))


def bvh_text(motion: BvhMotion) -> str:
    """A motion as the text of a BVH file."""
    values = np.round(motion.values, _DECIMALS) + 0.0  # the sum has no -0
    row = " ".join([f"%.{_DECIMALS}f"] * values.shape[1])
    lines = [
        "HIERARCHY",
        *_hierarchy(motion.skeleton),
        "MOTION",
        f"Frames: {len(values)}",
        f"Frame Time: {motion.frame_time:.9f}",
        *(row % tuple(frame) for frame in values.tolist()),
    ]
    return "\n".join(lines) + "\n"


def _hierarchy(skeleton: Skeleton) -> Iterator[str]:
    """The lines of all joints, each below its parent, whose other children are above it or below.

    The skeleton's order is that of the file, in which all that is below a joint comes next.
    """
    opened: list[int] = []
    for joint, parent in enumerate(skeleton.parents):
        while opened and opened[-1] != parent:
            opened.pop()
            yield _INDENT * len(opened) + "}"
        outer, inner = _INDENT * len(opened), _INDENT * (len(opened) + 1)
        channels = skeleton.channels[joint]
        yield f"{outer}{'JOINT' if opened else 'ROOT'} {skeleton.names[joint]}"
        yield outer + "{"
        yield f"{inner}OFFSET {_point(skeleton.offsets[joint])}"
        yield f"{inner}CHANNELS {' '.join((str(len(channels)), *channels))}"
        for site in skeleton.end_sites:
            if site.joint == joint:
                yield from (f"{inner}End Site", inner + "{")
                yield f"{inner}{_INDENT}OFFSET {_point(site.offset)}"
                yield inner + "}"
        opened.append(joint)
    yield from (_INDENT * depth + "}" for depth in reversed(range(len(opened))))


def _point(offset: Sequence[float]) -> str:
    return " ".join(f"{part:.{_DECIMALS}f}" for part in np.round(offset, _DECIMALS) + 0.0)
