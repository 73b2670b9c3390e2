"""What the tests of the reactions share: a humanoid that a ball hits, both sides in one process."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

from controller_node.behaviours.base import ModeReport
from controller_node.controller import Controller
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.geometry import rotations
from msgs_config.messages.state import StampedReference
from sim_node.physics.simulation import Simulation
from tests.support.physics import character, joint_simulation, make_driver

BALL_RADIUS = 0.1  # m
HUMANOID = character("humanoid")
LINKS = [link.name for link in HUMANOID.links]
RATE_HZ = 240
_PARKED = (50.0, 0.0, 0.1)  # m
_START = 0.35  # m, of the ball's middle from that of the link that it is thrown at
_BALL = """<robot name="ball"><link name="ball">
  <inertial><mass value="{mass}"/>
    <inertia ixx="{inertia}" ixy="0" ixz="0" iyy="{inertia}" iyz="0" izz="{inertia}"/></inertial>
  <visual><geometry><sphere radius="{radius}"/></geometry></visual>
  <collision><geometry><sphere radius="{radius}"/></geometry></collision>
</link></robot>"""


@dataclass(frozen=True)
class ProjectileThrow:
    """A ball that flies at a link of the humanoid from some side."""

    speed: float  # m/s
    tick: int
    link: str = "chest"
    direction: float = -0.5 * np.pi  # rad about z, of its flight: from the left


@dataclass
class Run:
    """What happened."""

    positions: FloatArray  # (t + 1, n)
    velocities: FloatArray  # (t + 1, n)
    efforts: FloatArray  # (t, n)
    references: list[StampedReference]
    modes: list[ModeReport]
    contacts: FloatArray  # (t, links, 6), of the ticks that led to the states
    ball_velocities: FloatArray  # (t, 3)

    def mode_names(self) -> list[str]:
        """The modes, one after the other."""
        return [report.phase.mode.value for report in self.modes]

    def tick_of(self, report: ModeReport) -> int:
        """The row of the state that a mode begins with."""
        return round(report.stamp_ns * RATE_HZ / 1e9) - 1


@lru_cache
def ball_file(mass: float) -> str:
    """The file of a ball of some kg, of even density."""
    folder = Path(mkdtemp())
    inertia = 0.4 * mass * BALL_RADIUS**2
    text = _BALL.format(mass=mass, inertia=inertia, radius=BALL_RADIUS)
    (folder / "ball.urdf").write_text(text, encoding="utf-8")
    (folder / "ball.yaml").write_text("urdf: ball.urdf\ninertia: file\n", encoding="utf-8")
    return str(folder / "ball.yaml")


def driver(given: Mapping[str, object], whole: Character = HUMANOID) -> Controller:
    """A controller of the humanoid; walks if nothing else is given."""
    return make_driver(whole, {"reference": "clip", **given})


def run(
    given: Mapping[str, object],
    ticks: int,
    throws: tuple[ProjectileThrow, ...] = (),
    mass: float = 2.0,
    is_over: Callable[[Sequence[ModeReport], int], bool] = lambda modes, stamp_ns: False,
) -> Run:
    """Let a humanoid be driven as the parameters say while a ball of some kg is thrown at it.

    It is over before all ticks if that is so by its modes and its time.
    """
    control = driver(given)
    start = control._own_reference.sample(0.0)
    layout, commanded = HUMANOID.layout, HUMANOID.layout.actuated_joint_names
    settings = {
        "characters": ["one", "ball"],
        "one.commanded_joints": ["root", *commanded],
        "one.initial_position": start.configuration.position.tolist(),
        "one.initial_velocity": start.velocity.tolist(),
        "ball.character": ball_file(mass),
        "ball.commanded_joints": [],
        "ball.initial_position": [*_PARKED, 0.0, 0.0, 0.0],
    }
    with joint_simulation(settings) as simulation:
        simulation.watches_contacts = True
        simulated, ball = simulation.characters
        episode_ns = simulated.state.stamp_ns
        positions, velocities = [simulated.state.position], [simulated.state.velocity]
        efforts, references, contacts, balls = [], [], [], []
        modes: list[ModeReport] = []
        for tick in range(ticks):
            for throw in throws:
                if throw.tick == tick:
                    _throw(simulation, throw)
            assert simulated.contacts is not None
            contacts.append(simulated.contacts.wrenches)
            effort, reference = control.compute_effort(
                simulated.state,
                episode_ns,
                simulated.contacts.wrenches if control.needs_contacts else None,
            )
            if control.mode is not None and control.mode is not (modes or [None])[-1]:
                modes.append(control.mode)
            simulation.step([effort, np.zeros(6)])
            positions.append(simulated.state.position)
            velocities.append(simulated.state.velocity)
            efforts.append(effort)
            references.append(reference)
            balls.append(ball.state.velocity[:3])
            if is_over(modes, simulated.state.stamp_ns):
                break
    assert layout.size == len(positions[0])
    return Run(
        np.array(positions),
        np.array(velocities),
        np.array(efforts),
        references,
        modes,
        np.array(contacts),
        np.array(balls),
    )


def _throw(simulation: Simulation, throw: ProjectileThrow) -> None:
    """Put the ball beside the link, on its way to it; it flies with the link's own root."""
    simulated, ball = simulation.characters
    origins, turns = simulated.link_frames()
    index = LINKS.index(throw.link)
    middle = np.array(HUMANOID.links[index].inertial_pose.position)
    centre = origins[index] + rotations.rotate(turns[index], middle)
    way = np.array((np.cos(throw.direction), np.sin(throw.direction), 0.0))
    place = np.zeros(6)
    place[:3] = centre - _START * way
    motion = np.zeros(6)
    motion[:3] = simulated.state.velocity[:3] + throw.speed * way
    ball._body.set_state(place, motion)
