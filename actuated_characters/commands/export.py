"""The command `actuated_characters export`: a run, a bag or a clip as CSV, BVH or glTF; a policy as
ONNX; a character as MJCF.
"""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from actuated_characters.commands.common.progress import progress_bar
from actuated_characters.commands.common.settings import (
    CHARACTER,
    Commands,
    add_command,
    add_robot,
    print_remarks,
    robot_source,
)
from actuated_characters.commands.common.skin_options import add_skin, given_skin
from msgs_config.errors import ConfigurationError, RecordingError
from msgs_config.whole_files import write_whole

if TYPE_CHECKING:  # it takes a while to import
    from actuated_characters.render.skin.given import GivenSkin
    from character_motion.export.trajectories import Trajectories
    from msgs_config.arrays import FloatArray

_CSV, _BVH, _GLTF, _ONNX, _MJCF = "CSV", "BVH", "glTF", "ONNX", "MJCF"
_BINARY = ".glb"
_FORMATS = {".csv": _CSV, ".bvh": _BVH, _BINARY: _GLTF, ".gltf": _GLTF, ".onnx": _ONNX}
_FORMATS[".xml"] = _MJCF
_KNOWN_TO = {  # the formats of options that not every format has
    "reference": (_CSV,),
    **dict.fromkeys(("topic", "base"), (_CSV, _BVH, _GLTF)),
    **dict.fromkeys(("from", "to", "fps"), (_BVH, _GLTF)),
    **dict.fromkeys(("units", "order"), (_BVH,)),
    "servos": (_MJCF,),
    **dict.fromkeys(("ground", "shapes", "skin", "skin-map"), (_GLTF,)),
}
_CENTIMETRES = 100.0  # in a metre
_ORDERS = ("ZXY", "ZYX", "XYZ", "XZY", "YXZ", "YZX")


def add_export(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    export = add_command(
        commands,
        _export,
        "export",
        "write a run, a bag or a clip as CSV, BVH or glTF, a policy as ONNX, a character as MJCF",
        "Write a recorded run or a clip as the suffix of --output says. .csv has one row a state: "
        "time_s (since the first state), stamp_ns, episode (from 1), then position.DOF (rad or "
        "m), velocity.DOF (rad/s or m/s) and effort.DOF (N m or N, applied in the tick before the "
        "state; empty where there was none) of each degree of freedom, read back to the last bit; "
        "of a clip time_s and positions. .bvh is the skeleton of one character; .glb (binary) and "
        ".gltf (text) are all characters as `render` draws them, and thrown balls. Both "
        "are y up, forward is z. .onnx is a trained policy for other runtimes, with joint names, "
        "gains and scales in its metadata (docs/policies.md). .xml is a character as a model of "
        "MuJoCo (docs/mjcf.md).",
        [
            "export runs/demo --output demo.csv",
            "export runs/demo --output demo.glb",
            "export walk --output walk.bvh --units cm",
            "export walk --output walk.onnx",
            "export humanoid --output humanoid.xml",
            "export walk --skin body.glb --output body_walk.glb",
            "export runs/demo --topic description_joint_states --output robot.glb",
        ],
    )
    export.add_argument(
        "source",
        metavar="SOURCE",
        help="a run's directory, a bag, or a clip: its name, or a .txt or .json file; for ONNX a "
        "policy: its name, or a file of `train`; for MJCF a character: its name or file",
    )
    export.add_argument(
        "--output", type=Path, required=True, metavar="FILE", help=f"a {_suffixes()} file"
    )
    export.add_argument("--overwrite", action="store_true", help="replace FILE")
    add_robot(
        export,
        "of a recording: which, where there are several; of a clip: whose it is (humanoid)",
    )
    _add_options_of_formats(export)


def _add_options_of_formats(export: argparse.ArgumentParser) -> None:
    """Add the options of `_KNOWN_TO`."""
    export.add_argument(
        "--reference",
        action="store_true",
        help="CSV of a run: reference_position.DOF and reference_velocity.DOF, too; empty where "
        "there was none",
    )
    export.add_argument("--from", type=float, metavar="S", help="BVH, glTF: start, s (0)")
    export.add_argument("--to", type=float, metavar="S", help="BVH, glTF: end, s (the last state)")
    export.add_argument(
        "--fps",
        type=float,
        metavar="HZ",
        help="BVH, glTF: frames a second (a clip's own; of a recording its rate, divided to 60 or "
        "less)",
    )
    export.add_argument("--units", choices=("m", "cm"), help="BVH: unit of length (m)")
    export.add_argument("--order", choices=_ORDERS, help="BVH: order of rotation channels (ZXY)")
    export.add_argument(
        "--servos",
        action="store_true",
        help="MJCF: actuators are servos with the character's gains, not motors",
    )
    export.add_argument("--ground", action="store_true", help="glTF: the plane z = 0, too")
    export.add_argument(
        "--shapes",
        action="store_true",
        help="glTF: the shapes themselves, not the skin around them",
    )
    add_skin(export, "glTF: ")


def _suffixes() -> str:
    *first, last = _FORMATS
    return f"{', '.join(first)} or {last}"


def _export(options: argparse.Namespace) -> None:
    kind = _FORMATS.get(options.output.suffix.lower())
    if kind is None:
        raise ConfigurationError(f"--output {options.output}: it must be a {_suffixes()} file")
    for name, kinds in _KNOWN_TO.items():
        value = getattr(options, name.replace("-", "_"))
        if value is not None and value is not False and kind not in kinds:
            raise ConfigurationError(
                f"--{name} is of {' and '.join(kinds)}; {options.output} is none"
            )
    _check_output(options.output, overwrite=options.overwrite)
    writers = {_CSV: _write_table, _ONNX: _write_policy, _MJCF: _write_character}
    writers.get(kind, _write_motion)(options, kind)


def _check_output(file: Path, *, overwrite: bool) -> None:
    """Raise RecordingError if a file must not be written, as can be known before all the work."""
    if file.is_dir():
        raise RecordingError(f"cannot write {file}: it is a directory")
    if not file.absolute().parent.is_dir():
        raise RecordingError(f"cannot write {file}: its directory does not exist")
    if file.exists() and not overwrite:
        raise RecordingError(f"{file} exists already; --overwrite replaces it")


def _check_alone(names: Sequence[str], kind: str) -> None:
    """Raise ConfigurationError if there are several characters, for a format that has one."""
    if len(names) > 1:
        raise ConfigurationError(
            f"{kind} has one character; name one by --character: {', '.join(names)}"
        )


def _write_table(options: argparse.Namespace, kind: str) -> None:
    from actuated_characters.export.joint_table import write_clip, write_joint_states
    from actuated_characters.export.sources import read_recorded, read_source

    robot = robot_source(options)
    recordings = read_recorded(options.source, robot, print_remarks)
    _check_alone([each.name for each in recordings], kind)
    if recordings:
        write_joint_states(recordings[0], options.output, reference=options.reference)
    elif options.reference:
        raise ConfigurationError(f"--reference is of a run; {options.source} is none")
    else:
        write_clip(read_source(options.source, robot), options.output)
    print(options.output)


def _write_policy(options: argparse.Namespace, kind: str) -> None:
    from actuated_characters.export.onnx_policy import onnx_model
    from controller_node.planner.policy.file import read_policy
    from msgs_config.character.loading import load_character

    del kind
    character = load_character(options.character or CHARACTER)
    model = onnx_model(read_policy(options.source, character), character)
    write_whole(options.output, model.SerializeToString())
    sizes = [
        f"{end.name} {end.type.tensor_type.shape.dim[1].dim_value}"
        for end in (*model.graph.input, *model.graph.output)
    ]
    print(f"{options.output}: {', '.join(sizes)}")


def _write_character(options: argparse.Namespace, kind: str) -> None:
    from msgs_config.character.loading import load_character
    from msgs_config.character.mjcf.writing import write_mjcf

    if options.character is not None:
        raise ConfigurationError(f"--character: of {kind} SOURCE is the character")
    written = write_mjcf(load_character(options.source), servos=options.servos)
    write_whole(options.output, written.text.encode())
    print(options.output, *written.left_out, sep="\n")


def _write_motion(options: argparse.Namespace, kind: str) -> None:
    from actuated_characters.export.sources import read_source

    skin = given_skin(options)
    motion = read_source(options.source, robot_source(options), print_remarks)
    start = getattr(options, "from")
    times = motion.sample_times(0.0 if start is None else start, options.to, options.fps)
    names = [each.name for each in motion.characters]
    if kind == _BVH:
        _check_alone(names, kind)
    if options.ground and not motion.has_plane:
        raise ConfigurationError(
            "--ground: the world of the recording has no plane, and another terrain is left out"
        )
    total = len(times) * len(motion.characters)
    with progress_bar(options.output.name, total, "frames", transient=True) as bar:

        def progress(done: int) -> None:
            bar.update(bar.task_ids[0], completed=done)

        if kind == _BVH:
            content = _bvh(options, motion, times, progress)
        else:
            content = _gltf(options, motion, times, progress, skin)
    write_whole(options.output, content)
    print(
        f"{options.output}: {', '.join(names)}, {len(times)} frames over "
        f"{times[-1] - times[0]:.2f} s, {len(content) / 1e6:.1f} MB"
    )


def _gltf(
    options: argparse.Namespace,
    motion: "Trajectories",
    times: "FloatArray",
    progress: Callable[[int], None],
    skin: "GivenSkin | None",
) -> bytes:
    from actuated_characters.export.gltf_scene import make_document

    document = make_document(
        motion,
        times,
        ground=options.ground,
        skinned=not options.shapes,
        skin=skin,
        progress=progress,
    )
    is_binary = options.output.suffix.lower() == _BINARY
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
