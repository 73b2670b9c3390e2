"""The fewest keys of each shipped clip, as a table of a page: `python -m benchmarks.keys`."""

import sys

from actuated_characters.keys.of_clip import keys_of_clip
from actuated_characters.keys.samples import Tolerances
from character_motion.clips.motion_clip import read_motion_clip
from msgs_config.character.loading import load_character
from msgs_config.clips.reading import available_clips


def main() -> int:
    """Print a row for each clip of the humanoid, or for those that are named."""
    character = load_character("humanoid")
    print("| clip | frames | a second | keys | share | worst angle, rad | worst place, mm |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name in sys.argv[1:] or available_clips(character):
        keyed = keys_of_clip(read_motion_clip(character, name), Tolerances())
        angle, place = keyed.angle, keyed.place
        cells = (
            f"`{name}`",
            str(len(keyed.clip.times)),
            f"{keyed.clip.rate:.0f}",
            str(len(keyed.found.keyframes.times)),
            f"{100 * keyed.share:.3g} %",
            "-" if angle is None else f"{angle.size:.3f} ({angle.joint})",
            "-" if place is None else f"{1e3 * place.size:.1f}",
        )
        print("| " + " | ".join(cells) + " |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
