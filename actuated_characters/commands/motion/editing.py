"""The commands `actuated_characters motion trim`, `loop`, `mirror`, `blend` and `speed`."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from actuated_characters.commands.common.settings import Commands, add_character, add_command
from actuated_characters.commands.common.tables import make_facts_table
from actuated_characters.commands.motion.files import (
    Conversion,
    make_folder_of,
    plan_conversions,
)

if TYPE_CHECKING:  # it takes a while to import
    from character_motion.clips.motion_clip import MotionClip
    from msgs_config.character.model import Character

    Edit = Callable[[argparse.Namespace, MotionClip], MotionClip]

_SUFFIX, _CLIPS = ".json", (".json", ".txt")


def add_motion_edits(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the commands to those of `actuated_characters motion`."""
    trim = _add(commands, "trim", _trim, "cut a clip", "motion trim walk.json --from 0.2 --to 0.8")
    _add_times(trim, "start, s (0)", "end, s (the clip's)")
    loop = _add(
        commands,
        "loop",
        _loop,
        "make a clip go on from its end, with its best cycle",
        "motion loop walk.json --output walk_cycle.json",
    )
    _add_times(loop, "start of the cycle, s (the best)", "its end, s (the best)")
    _add(commands, "mirror", _mirror, "exchange left and right", "motion mirror kick")
    blend = _add(
        commands, "blend", _blend, "let another clip follow", "motion blend walk run --over 0.4"
    )
    blend.add_argument("next", metavar="NEXT", help="the clip that follows: a name or a file")
    blend.add_argument("--over", type=float, default=0.3, metavar="S", help="s (%(default)s)")
    speed = _add(commands, "speed", _speed, "play a clip faster", "motion speed run --factor 0.8")
    speed.add_argument(
        "--factor", type=float, required=True, metavar="X", help="2 is twice as fast"
    )


def _add(
    commands: "Commands[argparse.ArgumentParser]", name: str, edit: "Edit", about: str, example: str
) -> argparse.ArgumentParser:
    def run(options: argparse.Namespace) -> None:
        _run(options, name, edit)

    description = f"{about.capitalize()}; of a folder, all clips in it."
    command = add_command(commands, run, name, about, description, [example])
    command.add_argument(
        "source", metavar="CLIP", help="a clip's name or file, or a folder of them"
    )
    add_character(command)
    command.add_argument(
        "--output",
        type=Path,
        metavar="FILE",
        help=f"a .json file, or a folder for those of a folder (CLIP-{name}, here)",
    )
    command.add_argument("--overwrite", action="store_true", help="replace files")
    return command


def _add_times(command: argparse.ArgumentParser, start: str, end: str) -> None:
    command.add_argument("--from", dest="start", type=float, metavar="S", help=start)
    command.add_argument("--to", dest="end", type=float, metavar="S", help=end)


def _run(options: argparse.Namespace, name: str, edit: "Edit") -> None:
    from msgs_config.character.loading import load_character

    character = load_character(options.character)
    conversions = plan_conversions(
        options.source,
        options.output,
        _CLIPS,
        _SUFFIX,
        beside=f"-{name}",
        overwrite=options.overwrite,
    )
    made = [(each, _edited(options, character, each, edit)) for each in conversions]
    for conversion, clip in made:  # all are sound, so all are written
        make_folder_of(conversion.output)
        clip.write(conversion.output)
    if len(made) == 1:
        _report(*made[0])
    else:
        print(f"{len(made)} clips in {made[0][0].output.parent}")


def _edited(
    options: argparse.Namespace, character: "Character", conversion: Conversion, edit: "Edit"
) -> "MotionClip":
    """The clip that is made, with its quality where the character stands on legs."""
    from dataclasses import replace

    from actuated_characters.commands.motion.info import target_of
    from character_motion.clips.motion_clip import read_motion_clip
    from character_motion.clips.quality import measure_quality

    clip = edit(options, read_motion_clip(character, conversion.source))
    target = target_of(character)
    if target is None:
        return clip
    return replace(clip, quality=measure_quality(target, clip).content())


def _report(conversion: Conversion, clip: "MotionClip") -> None:
    from actuated_characters.commands.motion.info import describe_quality

    facts = {
        "frames": f"{len(clip.times)}, {clip.rate:.4g} a second, {clip.duration:.3g} s",
        "goes on from its end": "yes" if clip.wraps else "no",
        **dict(describe_quality(clip.quality)),
    }
    Console().print(make_facts_table(str(conversion.output), facts.items()))


def _trim(options: argparse.Namespace, clip: "MotionClip") -> "MotionClip":
    from character_motion.clips.editing import trim

    return trim(clip, 0.0 if options.start is None else options.start, options.end)


def _loop(options: argparse.Namespace, clip: "MotionClip") -> "MotionClip":
    from character_motion.clips.editing import loop

    return loop(clip, options.start, options.end)


def _mirror(options: argparse.Namespace, clip: "MotionClip") -> "MotionClip":
    from character_motion.clips.editing import mirror

    del options
    return mirror(clip)


def _blend(options: argparse.Namespace, clip: "MotionClip") -> "MotionClip":
    from character_motion.clips.editing import blend
    from character_motion.clips.motion_clip import read_motion_clip

    return blend(clip, read_motion_clip(clip.character, options.next), options.over)


def _speed(options: argparse.Namespace, clip: "MotionClip") -> "MotionClip":
    from character_motion.clips.editing import change_speed

    return change_speed(clip, options.factor)
