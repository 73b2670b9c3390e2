"""The command `actuated_characters motion export`: motion as BVH or glTF."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from actuated_characters.commands.common.progress import progress_bar
from actuated_characters.commands.common.settings import (
    Commands,
    add_command,
    add_robot,
    print_remarks,
    robot_source,
)
from msgs_config.errors import ConfigurationError
from msgs_config.whole_files import write_whole

if TYPE_CHECKING:  # it takes a while to import
    from character_motion.export.trajectories import Trajectories
    from msgs_config.arrays import FloatArray

    Make = Callable[[argparse.Namespace, Trajectories, FloatArray, Callable[[int], None]], bytes]

_BVH, _GLTF, _GLB = ".bvh", ".gltf", ".glb"
_OF_BVH, _OF_GLTF = ("units", "order"), ("ground",)
_CENTIMETRES = 100.0  # in a metre
_ORDERS = ("ZXY", "ZYX", "XYZ", "XZY", "YXZ", "YZX")


def add_motion_export(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters motion`."""
    export = add_command(
        commands,
        _export,
        "export",
        "write a run, a bag or a clip as BVH or glTF",
        "Write what moves in a recorded run or in a clip, for tools of animation. The suffix of "
        "--output says the format: .bvh is the skeleton of one character; .glb (binary) and .gltf "
        "(text) are all characters with their shapes and colours, and thrown balls. Both are y "
        "up, forward is z.",
        [
            "motion export runs/demo --output demo.glb",
            "motion export walk --output walk.bvh --units cm",
            "motion export runs/demo --topic description_joint_states --output robot.glb",
        ],
    )
    export.add_argument(
        "source",
        metavar="SOURCE",
        help="a run's directory, a bag, or a clip: its name, or a .txt or .json file",
    )
    export.add_argument(
        "--output", type=Path, required=True, metavar="FILE", help="a .bvh, .glb or .gltf file"
    )
    add_robot(
        export,
        "of a recording: which, where there are several; of a clip: whose it is (humanoid)",
    )
    export.add_argument(
        "--from", dest="start", type=float, default=0.0, metavar="S", help="start, s (0)"
    )
    export.add_argument("--to", dest="end", type=float, metavar="S", help="end, s (the last state)")
    export.add_argument(
        "--fps",
        type=float,
        metavar="HZ",
        help="frames a second (a clip's own; of a recording its rate, divided to 60 or less)",
    )
    export.add_argument("--units", choices=("m", "cm"), help="BVH: unit of length (m)")
    export.add_argument("--order", choices=_ORDERS, help="BVH: order of rotation channels (ZXY)")
    export.add_argument("--ground", action="store_true", help="glTF: the plane z = 0, too")
    export.add_argument("--overwrite", action="store_true", help="replace FILE")


def _export(options: argparse.Namespace) -> None:
    suffix = options.output.suffix.lower()
    if suffix not in (_BVH, _GLTF, _GLB):
        raise ConfigurationError(
            f"--output {options.output}: it must be a {_BVH}, {_GLB} or {_GLTF} file"
        )
    for name in _OF_GLTF if suffix == _BVH else _OF_BVH:
        if getattr(options, name):
            kind = "glTF" if suffix == _BVH else "BVH"
            raise ConfigurationError(f"--{name} is of {kind}; {options.output} is none")
    from actuated_characters.export.sources import read_source
    from actuated_characters.report.joint_table import check_output

    check_output(options.output, overwrite=options.overwrite)
    motion = read_source(options.source, robot_source(options), print_remarks)
    times = motion.sample_times(options.start, options.end, options.fps)
    if suffix == _BVH and len(motion.characters) > 1:
        names = ", ".join(each.name for each in motion.characters)
        raise ConfigurationError(f"BVH has one skeleton; name one by --character: {names}")
    if options.ground and not motion.has_plane:
        raise ConfigurationError(
            "--ground: the world of the recording has no plane, and another terrain is left out"
        )
    total = len(times) * len(motion.characters)
    make = _bvh if suffix == _BVH else _gltf
    with progress_bar(options.output.name, total, "frames", transient=True) as bar:
        content = make(
            options, motion, times, lambda done: bar.update(bar.task_ids[0], completed=done)
        )
    write_whole(options.output, content)
    names = ", ".join(each.name for each in motion.characters)
    print(
        f"{options.output}: {names}, {len(times)} frames over {times[-1] - times[0]:.2f} s, "
        f"{len(content) / 1e6:.1f} MB"
    )


def _gltf(
    options: argparse.Namespace,
    motion: "Trajectories",
    times: "FloatArray",
    progress: Callable[[int], None],
) -> bytes:
    from actuated_characters.export.gltf_scene import make_document

    document = make_document(motion, times, ground=options.ground, progress=progress)
    is_binary = options.output.suffix.lower() == _GLB
    return document.to_glb() if is_binary else document.to_gltf()


def _bvh(
    options: argparse.Namespace,
    motion: "Trajectories",
    times: "FloatArray",
    progress: Callable[[int], None],
) -> bytes:
    from character_motion.bvh.writing import bvh_text
    from character_motion.export.bvh_motion import to_bvh

    (trajectory,) = motion.characters
    rate = motion.rate if options.fps is None else options.fps
    poses = motion.link_poses(trajectory, times, progress)
    scale = _CENTIMETRES if options.units == "cm" else 1.0
    written = to_bvh(trajectory.character, poses, rate, options.order or _ORDERS[0], scale)
    return bvh_text(written).encode()
