"""The command `actuated_characters motion info`: what is in a BVH file or a clip."""

import argparse
import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from actuated_characters.commands.common.settings import Commands, add_character, add_command
from actuated_characters.commands.common.tables import make_facts_table, make_table, show
from actuated_characters.commands.motion.files import find_files
from msgs_config.errors import ClipError

if TYPE_CHECKING:  # it takes a while to import
    from character_motion.clips.motion_clip import MotionClip
    from character_motion.retargeting.target_body import TargetBody
    from msgs_config.character.model import Character

_BVH, _CLIPS = ".bvh", (".json", ".txt")
_MOST_LIMITS = 6


def add_motion_info(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters motion`."""
    command = add_command(
        commands,
        _info,
        "info",
        "say what is in a BVH file or in a clip",
        "Say what is in a BVH file: its joints, which of a body they are, axes and units; or in a "
        "clip: where it comes from, contacts, and how good it is. Of a folder, a line each.",
        ["motion info walk.bvh", "motion info walk"],
    )
    command.add_argument(
        "source", metavar="SOURCE", help="a .bvh file, a clip by name or file, or a folder"
    )
    add_character(command)
    command.add_argument("--json", action="store_true", help="print it as JSON")


def _info(options: argparse.Namespace) -> int:
    from msgs_config.character.loading import load_character

    path = Path(options.source)
    character = load_character(options.character)
    if path.is_dir():
        return _folder(options, path, character)
    facts = _facts(character, options.source)
    if options.json:
        print(json.dumps(facts, indent=1))
    else:
        Console().print(make_facts_table(options.source, ((k, show(v)) for k, v in facts.items())))
    return 0


def _folder(options: argparse.Namespace, path: Path, character: "Character") -> int:
    rows, failed = [], 0
    for each in find_files(path, (_BVH, *_CLIPS)):
        try:
            rows.append({"file": str(each), **_facts(character, str(each))})
        except ClipError as error:
            print(f"error: {error}", file=sys.stderr)
            failed += 1
    if options.json:
        print(json.dumps(rows, indent=1))
    else:
        columns = ("file", "frames", "duration", "rate", "from", "licence")
        table = [[show(row.get(column)) for column in columns] for row in rows]
        Console().print(make_table(str(path), columns, table))
    return int(failed > 0)


def _facts(character: "Character", source: str) -> dict[str, Any]:
    if Path(source).suffix.lower() == _BVH:
        return dict(_bvh_facts(Path(source)))
    from character_motion.clips.motion_clip import read_motion_clip

    clip = read_motion_clip(character, source)
    return dict(_clip_facts(clip))


def _bvh_facts(path: Path) -> Iterator[tuple[str, Any]]:
    from character_motion.bvh.reading import read_bvh
    from character_motion.retargeting.plausibility import doubts_of_human
    from character_motion.retargeting.retargeting import (
        RetargetingSettings,
        read_body,
    )

    motion = read_bvh(path)
    skeleton = motion.skeleton
    yield "frames", len(motion.values)
    yield "duration", f"{(len(motion.values) - 1) * motion.frame_time:.3f} s"
    yield "rate", f"{1.0 / motion.frame_time:.4g} Hz"
    yield "joints", f"{len(skeleton.names)}, {skeleton.channel_count} channels"
    try:
        body, conventions = read_body(path, motion, RetargetingSettings())
    except ClipError as error:
        yield "not to be imported without --map", str(error)
        return
    yield "conventions", conventions.described()
    yield "leg length", f"{body.leg_length:.3f} m"
    doubts = doubts_of_human(body)
    yield "a human", "no doubt" if not doubts else "; ".join(doubts)
    for role, index in sorted(body.map.joints.items()):
        yield role, skeleton.names[index]


def _clip_facts(clip: "MotionClip") -> Iterator[tuple[str, Any]]:
    from character_motion.clips.quality import measure_quality

    yield "frames", len(clip.times)
    yield "duration", f"{clip.duration:.3f} s"
    yield "rate", f"{clip.rate:.4g} Hz"
    yield "goes on from its end", "yes" if clip.wraps else "no"
    source = clip.source
    yield "from", str(source.get("file", source.get("clip", "unknown")))
    yield "licence", str(source.get("licence", "unknown"))
    if source.get("edits"):
        yield "edits", "; ".join(map(str, source["edits"]))
    for point, spans in clip.contacts.items():
        yield f"{point} on the ground", ", ".join(f"{a:.2f}-{b:.2f}" for a, b in spans) or "never"
    target = target_of(clip.character)
    quality = clip.quality
    if target is not None:
        quality = {**quality, **measure_quality(target, clip).content()}
    yield from describe_quality(quality)


def target_of(character: "Character") -> "TargetBody | None":
    """The character as one that stands on legs; None if it is none."""
    from character_motion.retargeting.target_body import TargetBody

    try:
        return TargetBody(character)
    except ClipError:
        return None


def describe_quality(quality: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """The figures of a clip, by name, with their units."""
    if "feet_in_ground_m" in quality:
        yield "feet in the ground", f"{1e3 * max(quality['feet_in_ground_m'], 0.0):.1f} mm"
        deepest = f"{1e3 * quality['deepest_m']:.1f} mm, {quality['deepest_link']}"
        yield "deepest in the ground", deepest
    if "overlap_m" in quality:
        share = f"{100 * quality['overlap_share']:.0f} % of the frames"
        pair = f", {quality['overlap_pair']}, {share}" if quality["overlap_m"] > 0.0 else ""
        yield "deepest overlap", f"{1e3 * quality['overlap_m']:.1f} mm{pair}"
        yield "a foot stands", f"{100 * quality['standing_share']:.0f} % of the frames"
    if quality.get("swing_clearance_m") is not None:
        yield "swinging feet clear", f"{1e3 * quality['swing_clearance_m']:.1f} mm or more"
    if quality.get("skating_mean_m_s") is not None:
        mean, most = (1e2 * quality[f"skating_{key}_m_s"] for key in ("mean", "p95"))
        yield "skating of standing feet", f"{mean:.2f} cm/s, 95 % below {most:.2f} cm/s"
    if "limits_touched" in quality:
        limits = sorted(quality["limits_touched"].items(), key=lambda each: -each[1])
        texts = [f"{name} {100 * share:.0f} %" for name, share in limits[:_MOST_LIMITS]]
        yield "limits touched", ", ".join(texts) or "none"
        fastest = f"{quality['fastest_joint_rad_s']:.1f} rad/s, {quality['fastest_joint']}"
        yield "fastest joint", fastest
    if {"worst_joint", "worst_joint_mean_rad", "worst_joint_max_rad"} <= quality.keys():
        yield (
            "worst joint",
            f"{quality['worst_joint']}: {quality['worst_joint_mean_rad']:.3f} rad from the "
            f"captured one, at most {quality['worst_joint_max_rad']:.3f} rad",
        )
