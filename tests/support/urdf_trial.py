"""One URDF of other makers: its character held and let fall, its dynamics compared.

And each element of its file, read here by a parser of another kind, either counts or is in a line.
"""

from collections import Counter
from copy import deepcopy
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.dom import minidom
from xml.etree import ElementTree
from xml.parsers.expat import ExpatError

import numpy as np

from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import make_plan
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import JointType
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character
from msgs_config.character.urdf.repair import repair_urdf
from msgs_config.errors import ActuatedCharactersError, SimulationError
from msgs_config.shared_parameters import FROM_FILE, NO_COLLISIONS

HOLDS = 0.1  # rad or m, from the rest pose in the end
_ALTERED = (
    "links whose inertia",
    "links with a mass but no inertia",
    "no link has a mass",
    "joints that move no mass",
    "joints whose limits leave no room",
    "<inertia_scaling>",
    "axes of another length",
    "masses of at most",
)
_REMEDY = "'collision: none' does without"  # of what refuses a missing mesh
_STATES = 5  # in which the dynamics are compared


@dataclass(frozen=True)
class TrialResult:
    """What became of a URDF."""

    kind: str
    """ran, refused, diverged or diverged limp (without collisions or not); lost an element;
    traceback, crashed, too slow."""
    reason: str = ""
    size: int = 0  # degrees of freedom
    mass: float = 0.0  # kg
    drift: float = 0.0  # rad or m, from the rest pose in the end
    warnings: tuple[str, ...] = ()
    differences: dict[str, float] = field(default_factory=dict)
    """From Pinocchio's, of the largest entry; nothing where that cannot be."""

    @property
    def label(self) -> str:
        """The kind; of one that ran, whether it holds."""
        return "holds" if self.kind == "ran" and self.drift < HOLDS else self.kind


def try_urdf(path: Path, duration: float) -> TrialResult:
    """Hold the character of a URDF alone, then let it fall; an error that is not ours is raised.

    One that lacks meshes is tried again without collisions, as its refusal says.
    """
    result = _try(path, duration, collides=True)
    if result.kind == "refused" and _REMEDY in result.reason:
        again = _try(path, duration, collides=False)
        return replace(again, kind=f"{again.kind} without collisions", reason=result.reason)
    return result


def _try(path: Path, duration: float, *, collides: bool) -> TrialResult:
    character, drift = None, 0.0
    try:
        character = load_character(str(path), collides)
        drift = _drift(character, path, duration, collides)
    except ActuatedCharactersError as error:
        kind = "diverged" if isinstance(error, SimulationError) else "refused"
        result = TrialResult(kind, str(error))
    else:
        result = _let_fall(character, path, duration, collides)
    if character is None:
        return result
    silent = lost_without_a_line(path, character)
    if silent and result.kind == "ran":
        result = TrialResult("lost an element", f"no line names {', '.join(silent)}")
    return replace(
        result,
        size=character.layout.size,
        mass=character.mass,
        drift=drift,
        warnings=character.warnings,
        differences=compare_with_pinocchio(character),
    )


def _drift(
    character: Character, path: Path, duration: float, collides: bool, strength: float = 1.0
) -> float:
    """How far a character ends from its rest pose, rad or m, that is held with some strength."""
    settings = {"collision": FROM_FILE if collides else NO_COLLISIONS}
    strengths = {f"strength.{name}": strength for name in character.layout.actuated_joint_names}
    hold = {"reference": "hold"}
    plan = make_plan(str(path), duration, hold, settings, strengths, loaded=character)
    rest, drift = np.array(character.rest_position), 0.0
    for tick in ticks_in_process(plan):
        drift = float(np.abs(tick.following.position - rest).max(initial=0.0))
    return drift


def _let_fall(character: Character, path: Path, duration: float, collides: bool) -> TrialResult:
    try:
        _drift(character, path, duration, collides, strength=0.0)
    except SimulationError as error:
        return TrialResult("diverged limp", str(error))
    return TrialResult("ran")


def lost_without_a_line(path: Path, character: Character) -> list[str]:
    """The names of elements of a URDF that neither count nor are in a line of the character's.

    Nothing of a file that the judge, a parser with name spaces, does not read.
    """
    try:
        document = minidom.parseString(path.read_bytes().strip(b"\0 \t\r\n"))
    except (ExpatError, ValueError, LookupError):
        return []
    there, counted = Counter[str](), Counter(each.tag for each in character.loading.robot.iter())
    pending = [document.documentElement]
    while pending:
        element = pending.pop()
        assert element is not None
        there[element.tagName] += 1
        if not any(f"<{element.tagName}>" in line for line in character.warnings):
            pending += [each for each in element.childNodes if isinstance(each, minidom.Element)]
    gone = sorted(name for name, count in there.items() if count > counted[name])
    return [name for name in gone if not any(f"<{name}>" in line for line in character.warnings)]


def compare_with_pinocchio(character: Character) -> dict[str, float]:
    """How far mass matrix, bias force and gravity differ from Pinocchio's, of the largest entry.

    Nothing where Pinocchio is not there, has no such joints (ball joints), or refuses the file.
    """
    try:
        from tests.support.pinocchio_model import PinocchioModel
    except ImportError:
        return {}
    if any(joint.type is JointType.SPHERICAL for joint in character.moving_joints):
        return {}
    try:
        theirs = PinocchioModel(counting_text(character), character.layout)
    except ValueError:
        return {}  # what urdfdom refuses, such as a <limit> without effort
    ours, damping = DynamicsModel(character), character.passive_damping()
    worst = {"mass matrix": 0.0, "bias": 0.0, "gravity": 0.0}
    rng = np.random.default_rng(1)
    for _ in range(_STATES):
        position, velocity = rng.uniform(-1.0, 1.0, (2, character.layout.size))
        ours.update(position, velocity)
        bias = ours.bias_force() - damping * velocity
        found = (ours.mass_matrix(), bias, ours.gravity_force())
        for name, own, other in zip(worst, found, theirs.dynamics(position, velocity), strict=True):
            worst[name] = max(worst[name], _difference(own, other))
    return worst


def counting_text(character: Character) -> str:
    """The URDF's own text; where that had to be altered, the repaired one."""
    altered = any(warning.startswith(_ALTERED) for warning in character.warnings)
    if not altered:
        return character.loading.urdf_text
    robot = deepcopy(character.loading.robot)
    repair_urdf(robot, character.loading)
    return ElementTree.tostring(robot, encoding="unicode")


def _difference(own: FloatArray, other: FloatArray) -> float:
    largest = float(np.abs(other).max(initial=0.0))
    return float(np.abs(own - other).max(initial=0.0)) / largest if largest else 0.0
