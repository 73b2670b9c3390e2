"""The command `actuated_characters motion keys`: a clip made into few poses to edit."""

import argparse
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from actuated_characters.commands.common.progress import progress_bar
from actuated_characters.commands.common.settings import (
    CHARACTER,
    Commands,
    add_character,
    add_command,
)
from actuated_characters.commands.common.tables import make_facts_table, make_table
from actuated_characters.commands.motion.files import (
    Conversion,
    make_folder_of,
    plan_conversions,
)

if TYPE_CHECKING:  # it takes a while to import
    from actuated_characters.keys.of_clip import Deviation, KeyedClip
    from actuated_characters.keys.samples import Tolerances
    from msgs_config.character.model import Character

_SUFFIX, _CLIPS = ".yaml", (".json", ".txt")
_ANGLE, _PLACE = 0.05, 0.01  # rad, m
_FEW = 0.2  # keys for each frame, beyond which there is a remark


def add_motion_keys(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters motion`."""
    command = add_command(
        commands,
        _keys,
        "keys",
        "make few poses of a clip, to be edited",
        "Make keyframes of a clip: few poses whose smooth path stays within tolerances of it, at "
        "each frame and halfway between frames. Times and poses are free, so a pose need not be a "
        "frame's. Edit the file, and play it with `run --keyframes FILE`; of a folder, all clips "
        "in it.",
        ["motion keys jump --output jump.yaml", "motion keys clips --output keys --angle 0.1"],
    )
    command.add_argument(
        "source", metavar="CLIP", help="a clip's name or file, or a folder of them"
    )
    add_character(command)
    command.add_argument(
        "--output",
        type=Path,
        metavar="FILE",
        help="a .yaml file, or a folder for those of a folder (CLIP-keys, here)",
    )
    command.add_argument(
        "--angle",
        type=float,
        default=_ANGLE,
        metavar="RAD",
        help="the most by which a rotation may be off, rad (%(default)s)",
    )
    command.add_argument(
        "--place",
        type=float,
        default=_PLACE,
        metavar="M",
        help="the most by which the root's place may be off, m (%(default)s)",
    )
    command.add_argument(
        "--timeline",
        action="store_true",
        help="write timelines, for `take` and `author`, not keyframes",
    )
    command.add_argument("--overwrite", action="store_true", help="replace files")


def _keys(options: argparse.Namespace) -> None:
    from actuated_characters.keys.samples import Tolerances
    from msgs_config.character.loading import load_character

    tolerances = Tolerances(options.angle, options.place)
    conversions = plan_conversions(
        options.source,
        options.output,
        _CLIPS,
        _SUFFIX,
        beside="-keys",
        overwrite=options.overwrite,
    )
    character = load_character(options.character)
    made = [(each, _made(options, character, each, tolerances)) for each in conversions]
    if len(made) == 1:
        _report(options, *made[0])
    else:
        _print_table(made)


def _made(
    options: argparse.Namespace,
    character: "Character",
    conversion: Conversion,
    tolerances: "Tolerances",
) -> "KeyedClip":
    """The keys of a clip, written."""
    from actuated_characters.keys.keyframes_file import keyframes_text, timeline_text
    from actuated_characters.keys.of_clip import keys_of_clip
    from character_motion.clips.motion_clip import read_motion_clip
    from msgs_config.whole_files import write_whole

    clip = read_motion_clip(character, conversion.source)
    with progress_bar(f"keys of {conversion.source}", 1, transient=True) as bar:
        keyed = keys_of_clip(
            clip, tolerances, lambda share: bar.update(bar.task_ids[0], completed=share)
        )
    facts = [f"{name}: {value}" for name, value in _facts(keyed)]
    remark = "\n".join([f"Keys of the clip {conversion.source}", *facts])
    make_folder_of(conversion.output)
    keyframes = keyed.found.keyframes
    if options.timeline:
        text = timeline_text(character.layout, keyframes, remark, options.character)
    else:
        text = keyframes_text(character.layout, keyframes, remark)
    write_whole(conversion.output, text)
    return keyed


def _facts(keyed: "KeyedClip") -> Iterator[tuple[str, str]]:
    clip, keyframes = keyed.clip, keyed.found.keyframes
    yield "frames", f"{len(clip.times)}, {clip.rate:.4g} a second, {clip.duration:.3g} s"
    yield "keys", f"{len(keyframes.times)}, {100 * keyed.share:.3g} % of the frames"
    yield "worst angle", _described(keyed.angle, 1.0, "rad")
    yield "worst place", _described(keyed.place, 1e3, "mm")
    if keyframes.period is not None:
        yield "path", f"a loop of {keyframes.period:.3g} s"
    else:
        yield "path", "ends with the clip"


def _described(deviation: "Deviation | None", factor: float, unit: str) -> str:
    if deviation is None:
        return "-"
    size = f"{factor * deviation.size:.3g} {unit}"
    return f"{size}, {deviation.joint}, at {deviation.time:.3f} s"


def _remarks(keyed: "KeyedClip") -> Iterator[str]:
    from controller_node.references.keyframes import overshoots

    clip = keyed.clip
    if keyed.found.error > 1.0:
        yield f"the path leaves the tolerances, by {100 * (keyed.found.error - 1.0):.0f} %"
    if keyed.share > _FEW:
        yield (
            f"keys are more than a fifth of the frames: for {clip.rate:.3g} frames a second the "
            "motion turns fast; a larger --angle or --place needs fewer"
        )
    yield from overshoots(clip.character, keyed.found.keyframes)


def _report(options: argparse.Namespace, conversion: Conversion, keyed: "KeyedClip") -> None:
    console = Console()
    console.print(make_facts_table(str(conversion.output), _facts(keyed)))
    for remark in _remarks(keyed):
        console.print("remark:", remark, soft_wrap=True, markup=False, highlight=False)
    file = shlex.quote(str(conversion.output))
    words = f"actuated_characters take {file}"
    if not options.timeline:
        words = f"actuated_characters run --keyframes {file} --duration {keyed.clip.duration:.3f}"
    if options.character != CHARACTER and not options.timeline:
        words += f" --character {shlex.quote(options.character)}"
    console.print("play it:", words, soft_wrap=True, markup=False)


def _print_table(made: "list[tuple[Conversion, KeyedClip]]") -> None:
    columns = ("keys", "of frames", "number", "share, %", "worst angle", "worst place")
    rows = [
        (
            str(conversion.output),
            str(len(keyed.clip.times)),
            str(len(keyed.found.keyframes.times)),
            f"{100 * keyed.share:.3g}",
            _described(keyed.angle, 1.0, "rad"),
            _described(keyed.place, 1e3, "mm"),
        )
        for conversion, keyed in made
    ]
    console = Console()
    console.print(make_table("keys of clips", columns, rows))
    for conversion, keyed in made:
        for remark in _remarks(keyed):
            line = f"remark: {conversion.output}: {remark}"
            console.print(line, soft_wrap=True, markup=False, highlight=False)
