"""What tests of MJCF share: files, and MuJoCo's own model of them in a character's order."""

from pathlib import Path

import mujoco
import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import ROOT
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character

GRAVITY = 9.81  # m/s^2


def write_mjcf(folder: Path, bodies: str, rest: str = "", name: str = "robot.xml") -> Path:
    """A file of MuJoCo with these bodies, and what else is in it."""
    path = folder / name
    path.write_text(
        f'<mujoco><compiler angle="radian"/><worldbody>{bodies}</worldbody>{rest}</mujoco>'
    )
    return path


def load_mjcf(folder: Path, bodies: str, rest: str = "", *, collides: bool = True) -> Character:
    """The character of such a file."""
    return load_character(write_mjcf(folder, bodies, rest), collides)


class Original:
    """MuJoCo's own model of a file, asked in the order and the form of a character's states."""

    def __init__(self, path: Path, character: Character) -> None:
        self.model = mujoco.MjModel.from_xml_path(str(path))
        self.model.opt.gravity[:] = (0.0, 0.0, -GRAVITY)
        self._data, self._layout = mujoco.MjData(self.model), character.layout
        kinds = dict(zip(self._names(), self.model.jnt_type, strict=True))
        self._free = next((name for name, kind in kinds.items() if kind == 0), "")
        entries: list[int] = []
        for joint in self._layout.joints:
            start = int(self.model.joint(self._number(joint.name)).dofadr[0])
            entries += range(start, start + len(joint.dof_names))
        self.entries = entries

    def _names(self) -> list[str]:
        return [self.model.joint(number).name for number in range(self.model.njnt)]

    def _number(self, name: str) -> int:
        return self._names().index(self._free if name == ROOT else name)

    def random_state(self, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
        """Put the model into a state, which is returned in message form, each (n,)."""
        model, data, size = self.model, self._data, self._layout.size
        position, velocity = rng.uniform(-1.0, 1.0, size), rng.normal(size=size)
        data.qpos[:], data.qvel[:] = model.qpos0, 0.0
        data.qvel[self.entries] = velocity
        for joint in self._layout.joints:
            start = int(model.jnt_qposadr[self._number(joint.name)])
            turned = joint.rotation
            if turned is None:
                data.qpos[start] = position[joint.start]
                continue
            lead = turned.start - joint.start
            data.qpos[start : start + lead] = position[joint.start : turned.start]
            angle, quaternion = float(np.linalg.norm(position[turned])), np.empty(4)
            mujoco.mju_axisAngle2Quat(quaternion, position[turned] / angle, angle)
            data.qpos[start + lead : start + lead + 4] = quaternion
        mujoco.mj_forward(model, data)
        return position, velocity

    def mass_matrix(self) -> FloatArray:
        """The mass matrix (n, n) of the state."""
        whole = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self._data, whole)
        return whole[np.ix_(self.entries, self.entries)]

    def bias(self) -> FloatArray:
        """The bias (n,) of the state: Coriolis, centrifugal and gravity."""
        bias: FloatArray = self._data.qfrc_bias[self.entries]
        return bias

    def body_place(self, name: str) -> tuple[FloatArray, FloatArray]:
        """Centre of mass (3,) of a body in the world, and axes (3, 3) of its principal inertia."""
        body = self._data.body(name)
        return body.xipos.copy(), body.ximat.reshape(3, 3).copy()


BALL = '<geom type="sphere" size="0.1"/>'
BOX = '<geom type="box" size="0.05 0.1 0.2" pos="0 0.02 -0.2" euler="0.1 0.2 0.3"/>'
ROD = '<geom type="capsule" fromto="0.1 0 0 0.1 0.1 -0.5" size="0.03"/>'


def arm(joints: str, geom: str = BOX, more: str = "") -> str:
    """A body on the world, with joints."""
    return f'<body name="arm" pos="0.1 0.2 1" euler="0.3 -0.2 0.5">{joints}{geom}{more}</body>'


def torso(more: str, joint: str = '<freejoint name="base"/>') -> str:
    """A body that floats, with others on it."""
    return f'<body name="torso" pos="0 0 1" euler="0.2 0 0">{joint}{BALL}{more}</body>'


HINGE = '<joint name="h" axis="1 2 3" pos="0.1 0 0.2"/>'
FOREARM = f'<body name="forearm" pos="0 0 -0.4"><joint name="e" axis="0 1 0"/>{ROD}</body>'
SEVERAL = (
    '<joint name="x" axis="1 0 0" pos="0 0 0.1"/><joint name="y" axis="0 1 0" pos="0.1 0 0"/>'
    '<joint name="s" type="slide" axis="0 0.6 0.8"/><joint name="z" axis="0 0.1 1" pos="0 0.2 0"/>'
)
FILES = {
    "hinge off the body's origin": arm(HINGE),
    "slider": arm('<joint name="s" type="slide" axis="1 0 1"/>'),
    "ball": arm('<joint name="b" type="ball" pos="0.1 0.2 0.3"/>'),
    "free": torso(""),
    "free, with limbs": torso(arm(HINGE, more=FOREARM) + arm(SEVERAL).replace("arm", "leg")),
    "free, with the default's armature": torso(
        arm(HINGE), '<joint name="base" type="free" armature="0.2"/>'
    ),
    "several joints on one body": arm(SEVERAL, more=FOREARM),
    "a ball after a hinge": arm(
        '<joint name="h" axis="0 1 0" pos="0 0 .1"/><joint name="b" type="ball" pos="0 .1 0"/>',
        more=FOREARM,
    ),
    "positions that count from elsewhere": arm(
        '<joint name="s" type="slide" axis="0 0 1" ref="1.25"/>'
        '<joint name="h" axis="1 1 0" pos="0.1 0 0" ref="0.7"/>',
        more=FOREARM,
    ),
    "armature": arm('<joint name="h" axis="1 2 3" armature="0.3"/>')
    + '<body name="other"><joint name="b" type="ball" armature="0.2"/>'
    + ROD
    + "</body>",
    "inertia of its own": arm(
        HINGE,
        '<inertial mass="2" pos="0.1 0.2 0.3" fullinertia="0.3 0.2 0.25 0.02 -0.03 0.01"/>' + BOX,
    ),
    "a body that is fixed to another": arm(
        HINGE, more='<body name="hand" pos="0 0 -0.5" euler="1 0 0">' + ROD + "</body>"
    ),
    "a frame": arm(HINGE, more='<body name="tip" pos="0 0 -0.5"/>'),
}
