"""The fewest keys of clips, as a table of a page: `python -m benchmarks.keys [CLIP ...]`."""

import sys
import time
from pathlib import Path

from actuated_characters.keys.of_clip import keys_of_clip
from actuated_characters.keys.samples import Tolerances
from character_motion.clips.motion_clip import read_motion_clip
from msgs_config.character.loading import load_character
from msgs_config.clips.reading import available_clips


def main() -> int:
    """Print a row for each clip of the humanoid, or for those that are named, or files."""
    character = load_character("humanoid")
    columns = ["clip", "frames", "a second", "keys", "share", "numbers"]
    columns += ["worst angle, rad", "worst place, mm", "CPU, s a second"]
    print("| " + " | ".join(columns) + " |")
    print("| " + " | ".join("---" for _ in columns) + " |")
    for name in sys.argv[1:] or available_clips(character):
        clip, begin = read_motion_clip(character, name), time.process_time()
        keyed = keys_of_clip(clip, Tolerances())
        seconds = (time.process_time() - begin) / clip.duration
        angle, place = keyed.angle, keyed.place
        cells = (
            f"`{Path(name).stem}`",
            str(len(keyed.clip.times)),
            f"{keyed.clip.rate:.0f}",
            str(len(keyed.found.keyframes.times)),
            f"{100 * keyed.share:.3g} %",
            f"{100 * keyed.numbers:.0f} %",
            "-" if angle is None else f"{angle.size:.3f} ({angle.joint})",
            "-" if place is None else f"{1e3 * place.size:.1f}",
            f"{seconds:.1f}",
        )
        print("| " + " | ".join(cells) + " |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
