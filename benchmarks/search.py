"""The search for a motion to go on with: how long it takes over the whole library of the humanoid.

A reaction does it in one tick, which is 4 ms at 240 Hz; in lockstep the simulator waits.
"""

import time

import numpy as np
from rich.console import Console

from benchmarks.support.printed import make_table
from benchmarks.support.ratios import Ratio
from benchmarks.support.timing import yardstick_us
from controller_node.behaviours.motion_library import MotionLibrary
from controller_node.references.clip import ClipReference
from msgs_config.character.loading import load_character
from msgs_config.clips.reading import read_clip

_STATES = 30  # states of a walk, each looked for once
_BLEND_DURATION = 0.5  # s, the default of `blend.duration`


def measure_search(console: Console) -> list[Ratio]:
    """Measure and print the table; the ratio of the median search to the yardstick."""
    console.print("search of the library: humanoid ...")
    humanoid = load_character("humanoid")
    library = MotionLibrary(humanoid, [], _BLEND_DURATION)
    walk = ClipReference(humanoid.layout, read_clip(humanoid, "walk"))
    durations = []
    for number in range(_STATES):
        state = walk.sample(number / _STATES)
        started = time.process_time()
        library.nearest(library.predicted(state.configuration.position, state.velocity))
        durations.append(1e3 * (time.process_time() - started))
    first, others = durations[0], durations[1:]
    median = float(np.median(others))
    heading = ("moments", "the first", "median", "longest of the others")
    numbers = [f"{number:.1f}" for number in (first, median, max(others))]
    title = "one search of the whole library (ms)"
    console.print(make_table(title, heading, (str(len(library)), *numbers)))
    return [Ratio("search of the library", 1e3 * median / yardstick_us(), "search / yardstick")]
