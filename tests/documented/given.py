"""Makes what a reader of the pages has already: captures, clips, and the pages' own code."""

import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.documented.collecting import ROOT
from tests.support.capture_makers import MAKERS as CAPTURE_MAKERS
from tests.support.captures import capture
from tests.support.hinged_humanoid import write_robot
from tests.support.mjcf import FILES, write_mjcf
from tests.support.networks import QUADRUPED_SIZE, Mlp
from tests.support.skins import skinned_glb

_PROGRAM = ROOT / ".venv/bin/actuated_characters"


def make(name: str, place: Path) -> None:
    """Make a file or a folder of a name in a place; raises KeyError where nobody knows how."""
    MAKERS[name](place / name)


def _capture(path: Path) -> None:
    capture(path, CAPTURE_MAKERS["mixamo"])


def _captures(path: Path) -> None:
    path.mkdir()
    for clip in ("walk", "run"):
        capture(path / f"{clip}.bvh", CAPTURE_MAKERS["mixamo"], clip)


def _long_clip(path: Path) -> None:
    """A clip of 6 s of walking, imported from BVH."""
    own = path.with_name("own")
    run = ("run", "--clip", "walk", "--duration", "6", "--composed", "--output", own)
    _call(path, *run)
    _call(path, "export", own, "--output", own / "own.bvh")
    _call(path, "motion", "import", own / "own.bvh", "--output", path)
    shutil.rmtree(own)


def _clips(path: Path) -> None:
    own = path.with_name("own_captures")
    _captures(own)
    _call(path, "motion", "import", own, "--output", path)
    shutil.rmtree(own)


def _cycles(path: Path) -> None:
    path.mkdir()
    clip = path.with_name("own.json")
    _long_clip(clip)
    _call(path, "motion", "loop", clip, "--output", path / "cycle.json")


def _timeline(path: Path) -> None:
    """Two seconds with an arm that is raised."""
    poses = "[{at: 1.0, pose: {right_elbow: 1.0}}]"
    path.write_text(f"duration: 2\nkeys: [{{poses: {poses}}}]\n", encoding="utf-8")


def _takes(path: Path) -> None:
    """Two takes of a timeline, the second one of an arm that is raised less."""
    file = path.with_name("dance.yaml")
    _timeline(file)
    _call(file, "take", file)
    file.write_text(file.read_text(encoding="utf-8").replace("1.0}", "0.8}"), encoding="utf-8")
    _call(file, "take", file)


def _robot(path: Path) -> None:
    write_robot(path)


def _mjcf(path: Path) -> None:
    write_mjcf(path.parent, FILES["several joints on one body"], name=path.name)


def _robots(path: Path) -> None:
    maker = path / "maker"
    maker.mkdir(parents=True)
    write_robot(maker / "robot.urdf")


def _body(path: Path) -> None:
    """A skinned mesh with the names of Mixamo, in cm."""
    path.write_bytes(skinned_glb(scale=100.0))


def _joints(path: Path) -> None:
    path.write_text("left_knee: mixamorig:LeftLeg\nleft_wrist:\n", encoding="utf-8")


def _call(path: Path, *words: object) -> None:
    command = [str(_PROGRAM), *map(str, words)]
    subprocess.run(command, cwd=path.parent, check=True, capture_output=True)


def _code(page: str, word: str) -> Callable[[Path], None]:
    """The block of Python of a page that has a word in it."""

    def write(path: Path) -> None:
        text = (ROOT / page).read_text(encoding="utf-8")
        (code,) = [
            block
            for block in re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
            if word in block
        ]
        path.write_text(code, encoding="utf-8")

    return write


def _policy(path: Path) -> None:
    """A network that nearly always answers zero, with the description of the page."""
    network = Mlp(QUADRUPED_SIZE, 12)
    network.weights["w2"] *= 0.01
    network.weights["b2"] *= 0.0
    network.write(path)
    page = (ROOT / "docs/policies.md").read_text(encoding="utf-8")
    (description,) = re.findall(r"```yaml\n(.*?)```", page, flags=re.DOTALL)
    path.with_suffix(".yaml").write_text(description, encoding="utf-8")


def _trace(path: Path) -> None:
    """Three decisions of a robot that stands still, as its trainer would log them."""
    default = [0.0] * 8 + [-0.7] * 4
    states = {
        "root_quat_wxyz": (1.0, 0.0, 0.0, 0.0),
        "root_ang_vel_b": (0.0, 0.0, 0.0),
        "command": (0.5, 0.0, 0.0),
        "joint_pos": default,
        "joint_vel": [0.0] * 12,
        "last_action": [0.0] * 12,
        "obs": [0.0] * 3 + [0.0, 0.0, -1.0] + [1.0, 0.0, 0.0] + [0.0] * 36,
    }
    np.savez(path, **{key: np.tile(row, (3, 1)) for key, row in states.items()})


def _copy_of(file: str) -> Callable[[Path], None]:
    return lambda path: shutil.copy(ROOT / file, path) and None


MAKERS: dict[str, Callable[[Path], None]] = {
    "my_capture.bvh": _capture,
    "walk.bvh": _capture,
    "captures": _captures,
    "walk.json": _long_clip,
    "clips": _clips,
    "cycles": _cycles,
    "reconstructed.json": _copy_of("tests/data/walk_reconstructed.json"),
    "trained.npz": _copy_of("controller_node/planner/policy/shipped/walk.npz"),
    "robot.urdf": _robot,
    "robot.xml": _mjcf,
    "robots": _robots,
    "my_machine.yaml": _copy_of("controller_node/behaviours/state_machine/data/walk.yaml"),
    "my_policy.onnx": _policy,
    "trace.npz": _trace,
    "dance.yaml": _timeline,
    "dance.takes": _takes,
    "body.glb": _body,
    "joints.yaml": _joints,
    "swing.py": _code("README.md", "class Swing"),
    "holder.py": _code("docs/python.md", "class Holder"),
}
