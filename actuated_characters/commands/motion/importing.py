"""The command `actuated_characters motion import`: BVH files made into clips of a character."""

import argparse
import shlex
import sys
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
from actuated_characters.commands.common.tables import make_facts_table, make_table, show
from actuated_characters.commands.motion.files import (
    Conversion,
    make_folder_of,
    plan_conversions,
)
from character_motion.bvh.axes_and_units import AXES, UNITS
from msgs_config.errors import ClipError, RecordingError

if TYPE_CHECKING:  # it takes a while to import
    from character_motion.clips.importing import ImportedClip
    from character_motion.retargeting.retargeting import RetargetingSettings
    from character_motion.retargeting.target_body import TargetBody

_SUFFIX, _BVH = ".json", (".bvh",)


def add_motion_import(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters motion`."""
    command = add_command(
        commands,
        _import,
        "import",
        "make clips of BVH files, retargeted to a character",
        "Make a clip of a BVH file, retargeted to a character by inverse kinematics; of a folder "
        "one of each file in it. Axes, units, the pose at rest and the joints are found out and "
        "printed; a clip is played by `run --clip FILE`. Beside it, unless --no-picture is given, "
        "comes a strip of pictures, the captured skeleton beside the character.",
        ["motion import walk.bvh --output walk.json", "motion import captures --output clips"],
    )
    command.add_argument("source", metavar="FILE", help="a .bvh file, or a folder of them")
    add_character(command)
    command.add_argument(
        "--output",
        type=Path,
        metavar="FILE",
        help="a .json file, or a folder for those of a folder (the source's name, here)",
    )
    command.add_argument(
        "--map",
        type=Path,
        metavar="YAML",
        help="joints by role, such as 'left_knee: LeftLeg', where names do not tell; those of the "
        "character under 'target'",
    )
    command.add_argument("--up", choices=AXES, metavar="AXIS", help="x, y, z, -x, -y or -z")
    command.add_argument("--units", choices=[*UNITS], help="the unit of length")
    command.add_argument(
        "--ground", action="store_true", help="put feet that float, as of a suit, on the ground"
    )
    command.add_argument(
        "--from", dest="start", type=float, default=0.0, metavar="S", help="start, s (0)"
    )
    command.add_argument("--to", dest="end", type=float, metavar="S", help="end, s (the last)")
    command.add_argument("--licence", default="", metavar="TEXT", help="of the files; kept")
    command.add_argument("--no-picture", action="store_true", help="make no strip of pictures")
    command.add_argument("--overwrite", action="store_true", help="replace files")


def _import(options: argparse.Namespace) -> int:
    from character_motion.retargeting.retargeting import RetargetingSettings
    from character_motion.retargeting.skeleton_map import GivenJoints, read_map
    from character_motion.retargeting.target_body import TargetBody
    from msgs_config.character.loading import load_character

    conversions = plan_conversions(
        options.source, options.output, _BVH, _SUFFIX, beside="", overwrite=options.overwrite
    )
    for conversion in conversions:
        picture = _picture(conversion)
        if not (options.no_picture or options.overwrite) and picture.exists():
            raise RecordingError(f"{picture} exists already; --overwrite replaces it")
    given = GivenJoints({}, {}) if options.map is None else read_map(options.map)
    settings = RetargetingSettings(given.source, options.up, options.units, options.ground)
    target = TargetBody(load_character(options.character), given.target)
    several = len(conversions) > 1
    done, failed = [], 0
    for conversion in conversions:
        try:
            made = _convert(options, conversion, target, settings)
        except ClipError as error:
            if not several:
                raise
            print(f"error: {error}", file=sys.stderr)
            failed += 1
            continue
        done.append((conversion, made))
        if not several:
            _report(options, conversion, made)
    if several:
        _print_table(options, done)
        if failed:
            print(f"{failed} of {len(conversions)} files were not imported", file=sys.stderr)
    return int(failed > 0)


def _convert(
    options: argparse.Namespace,
    conversion: Conversion,
    target: "TargetBody",
    settings: "RetargetingSettings",
) -> "ImportedClip":
    from character_motion.clips.importing import import_bvh

    path, totals = Path(conversion.source), [1]
    with progress_bar(path.name, 1, "frames", transient=True) as bar:

        def progress(done: int, total: int) -> None:
            totals[0] = total
            bar.update(bar.task_ids[0], completed=done, total=total)

        made = import_bvh(
            path,
            target,
            settings,
            part=(options.start, options.end),
            licence=options.licence,
            progress=progress,
        )
    make_folder_of(conversion.output)
    made.clip.write(conversion.output)
    if not options.no_picture:
        from actuated_characters.commands.motion.pictures import comparison_strip
        from actuated_characters.render.stills import save_png

        save_png(comparison_strip(target, made.retargeted), _picture(conversion))
    return made


def _picture(conversion: Conversion) -> Path:
    return conversion.output.with_suffix(".png")


def _report(options: argparse.Namespace, conversion: Conversion, made: "ImportedClip") -> None:
    """Print what was found out, the figures, and the command that plays the clip."""
    from actuated_characters.commands.motion.info import describe_quality

    clip, conventions = made.clip, made.retargeted.conventions
    facts = {
        "frames": f"{len(clip.times)}, {clip.rate:.4g} a second, {clip.duration:.3g} s",
        "file": conventions.described(),
        "scale": f"{made.retargeted.scale:.4g} m of the character for a unit of the file",
        **dict(describe_quality(clip.quality)),
    }
    console = Console()
    console.print(make_facts_table(str(conversion.output), facts.items()))
    for remark in made.remarks:
        console.print("remark:", remark, soft_wrap=True, markup=False, highlight=False)
    if not options.no_picture:
        print(f"picture: {_picture(conversion)}")
    words = f"actuated_characters run --clip {shlex.quote(str(conversion.output))}"
    words += f" --duration {clip.duration:.3f}"
    if options.character != CHARACTER:
        words += f" --character {shlex.quote(options.character)}"
    console.print("play it:", words, soft_wrap=True, markup=False)


def _print_table(
    options: argparse.Namespace, done: "list[tuple[Conversion, ImportedClip]]"
) -> None:
    columns = (
        *("clip", "s", "Hz", "up", "unit", "rest", "in ground, mm", "skating, cm/s"),
        *("worst joint", "rad"),
    )
    rows = []
    for conversion, made in done:
        clip, quality, conventions = made.clip, made.quality, made.retargeted.conventions
        skating = quality.skating_mean_m_s
        rows.append(
            (
                str(conversion.output),
                show(clip.duration, 3),
                show(clip.rate, 4),
                conventions.up,
                conventions.unit,
                conventions.rest,
                f"{1e3 * max(quality.feet_in_ground_m, 0.0):.1f}",
                show(None if skating is None else 1e2 * skating, 2),
                made.worst_joint,
                show(made.worst_mean_rad, 2),
            )
        )
    title = f"clips of {Path(options.character).stem}"
    console = Console()
    console.print(make_table(title, columns, rows))
    for conversion, made in done:
        for remark in made.remarks:
            line = f"remark: {conversion.output}: {remark}"
            console.print(line, soft_wrap=True, markup=False, highlight=False)
