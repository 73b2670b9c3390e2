"""What of an MJCF file no character has: a line for each kind, which names what there is."""

import re
from collections.abc import Callable, Iterable, Iterator

import mujoco
import numpy as np

from msgs_config.character.mjcf.compiling import CompiledMjcf
from msgs_config.character.mjcf.robot import Robot
from msgs_config.character.urdf.file_formats.vocabulary import LeftOut, listed

_BALL = int(mujoco.mjtJoint.mjJNT_BALL)
_SITE = int(mujoco.mjtObj.mjOBJ_SITE)
_OPTIONS = (
    *("timestep", "gravity", "integrator", "solver", "iterations", "cone", "impratio", "tolerance"),
    *("jacobian", "noslip_iterations", "wind", "density", "viscosity", "magnetic"),
    *("disableflags", "enableflags", "ls_iterations", "o_margin", "ccd_iterations"),
)
_PLURALS = {
    "tendon": "tendons",
    "pair": "pairs",
    "exclude": "excludes",
    "camera": "cameras",
    "light": "lights",
    "flex": "flexes",
    "plugin": "plugins",
    "numeric": "numerics",
    "text": "texts",
    "tuple": "tuples",
}
_SOLVER = (0.02, 1.0, 0.9, 0.95, 0.001, 0.5, 2.0)  # MuJoCo's own solref and solimp
_OF_PICTURES = ("visual", "statistic", "size")


def remark_joints(mjcf: CompiledMjcf, robot: Robot) -> Iterator[LeftOut]:
    """A line for each kind of what joints do not have here."""
    model, found = mjcf.model, dict[str, list[str]]()

    def add(kind: str, name: str) -> None:
        found.setdefault(kind, []).append(name)

    for joint, name in robot.joints.items():
        dof, is_ball = int(model.jnt_dofadr[joint]), model.jnt_type[joint] == _BALL
        if np.any(model.jnt_stiffness[joint]) or np.any(model.jnt_stiffnesspoly[joint]):
            add("stiffness", name)
        if np.any(model.dof_dampingpoly[dof]):
            add("damping that grows with speed", name)
        if is_ball and model.jnt_limited[joint]:
            add("range of a ball joint", name)
        if is_ball and model.dof_frictionloss[dof]:
            add("frictionloss of a ball joint", name)
        limit = (*model.jnt_solref[joint], *model.jnt_solimp[joint])
        if model.jnt_limited[joint] and not np.allclose(limit, _SOLVER):
            add("solreflimit and solimplimit", name)
        friction = (*model.dof_solref[dof], *model.dof_solimp[dof])
        if model.dof_frictionloss[dof] and not np.allclose(friction, _SOLVER):
            add("solreffriction and solimpfriction", name)
        if np.any(model.jnt_margin[joint]):
            add("margin of a joint's range", name)
    for body in robot.bodies:
        if np.any(model.body_gravcomp[body]):
            add("gravcomp", robot.links[body])
        if model.body_mocapid[body] >= 0:
            add("mocap", robot.links[body])
    if robot.floats:
        _remark_base(model, robot, add)
    for kind, names in found.items():
        yield LeftOut(kind.split()[0], f"left out: {kind} ({len(names)}): {listed(names)}")


def _remark_base(model: mujoco.MjModel, robot: Robot, add: Callable[[str, str], None]) -> None:
    dofs = slice(0, 0)
    for joint in range(model.njnt):
        if model.jnt_bodyid[joint] == robot.bodies[0]:
            dofs = slice(int(model.jnt_dofadr[joint]), int(model.jnt_dofadr[joint]) + 6)
    for kind in ("damping", "frictionloss"):
        if np.any(getattr(model, f"dof_{kind}")[dofs]):
            add(f"{kind} of a floating base", robot.links[robot.bodies[0]])


def remark_elements(mjcf: CompiledMjcf) -> Iterator[LeftOut]:
    """A line for each kind of element that nothing here stands for."""
    spec, model = mjcf.spec, mjcf.model
    for kind, plural in _PLURALS.items():
        yield from _elements(kind, [each.name for each in getattr(spec, plural)])
    measured = {
        int(model.sensor_objid[sensor])
        for sensor in range(model.nsensor)
        if model.sensor_objtype[sensor] == _SITE
    }
    sites = [mjcf.name("site", site) for site in range(model.nsite) if site not in measured]
    yield from _elements("site", sites)
    usual = mujoco.MjModel.from_xml_string("<mujoco/>").opt
    others = [
        name
        for name in _OPTIONS
        if not np.array_equal(getattr(model.opt, name), getattr(usual, name))
    ]
    if others:
        yield LeftOut(
            "option",
            f"left out: <option>, for which parameters of sim_node stand: {', '.join(others)}",
        )
    text = mjcf.path.read_text(errors="replace")  # without what it includes
    for kind in _OF_PICTURES:
        if re.search(rf"<{kind}[ >/]", text):
            yield LeftOut(kind, f"left out: <{kind}>")


def _elements(kind: str, names: Iterable[str]) -> Iterator[LeftOut]:
    names = list(names)
    if names:
        named = listed(name for name in names if name)
        yield LeftOut(kind, f"left out: <{kind}> ({len(names)})" + (f": {named}" if named else ""))
