"""A scene of several characters in one process, without ROS, and what touches whom there."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from actuated_characters.metrics.state_hash import StateHash
from actuated_characters.scenes.scene import SIMULATOR, Scene
from controller_node import parameters as for_controller
from controller_node.controller import Controller
from controller_node.references.factory import make_motion
from msgs_config.arrays import FloatArray
from msgs_config.character.loading import load_character
from msgs_config.messages.state import StampedState
from msgs_config.shared_parameters import placed
from sim_node.parameters import load_parameters
from sim_node.physics.mujoco.body import MujocoBody
from sim_node.physics.simulation import Simulation
from sim_node.simulation_factory import make_character_setup, make_simulation_settings
from tests.support.engines import pybullet


@dataclass(frozen=True)
class Brawl:
    """What two characters did in t ticks."""

    positions: FloatArray  # (t + 1, 2, n)
    efforts: FloatArray  # (t, 2, n), as applied
    together: FloatArray  # (t + 1,): normal force in N between the two, by the engine itself
    modes: tuple[list[str], list[str]]  # one after another, each with the clip that it leads to
    hashes: dict[str, str]

    @property
    def heights(self) -> FloatArray:
        """The roots' heights (t + 1, 2) in m."""
        return self.positions[:, :, 2]


def _make_controllers(scene: Scene) -> Iterator[tuple[Controller, StampedState]]:
    for name in scene.characters:
        given = scene.nodes[f"{name}/controller_node"]
        character = placed(load_character(str(given["character"])), given)
        values = for_controller.resolve_for(character, given)
        motion = make_motion(character, values)
        yield (
            for_controller.make_controller(character, motion.reference, values),
            motion.first_state(),
        )


def brawl_in_process(scene: Scene, ticks: int) -> Brawl:
    """Run a scene of two."""
    parts = load_parameters(scene.nodes[SIMULATOR]).characters
    drivers, starts = zip(*_make_controllers(scene), strict=True)
    hashes = {name: StateHash() for name in scene.characters}
    positions, efforts, together = [], [], []
    modes: tuple[list[str], list[str]] = ([], [])
    setups = [make_character_setup(part.character, part.values, part.name) for part in parts]
    with Simulation(setups, make_simulation_settings(parts[0].values)) as simulation:
        simulation.watches_contacts = True
        simulation.begin_in(dict(zip(scene.characters, starts, strict=True)))
        begin_ns = simulation.stamp_ns
        one, other = simulation.characters
        for tick in range(ticks + 1):
            for name, each in zip(scene.characters, (one, other), strict=True):
                hashes[name].add(each.state)
            positions.append([one.state.position, other.state.position])
            together.append(_force_between(simulation))
            if tick == ticks:
                break
            commands = []
            for row, (mine, theirs) in enumerate(((one, other), (other, one))):
                assert mine.contacts is not None
                effort, _ = drivers[row].compute_effort(
                    mine.state, begin_ns, mine.contacts.wrenches, theirs.state.position[:3]
                )
                commands.append(effort)
                content = drivers[row].mode.content()
                mode = f"{content['mode']} {content.get('clip', '')}".strip()
                if [mode] != modes[row][-1:]:
                    modes[row].append(mode)
            simulation.step(commands)
            efforts.append([one.state.effort, other.state.effort])
    found = {name: digest.hexdigest() for name, digest in hashes.items()}
    return Brawl(np.array(positions), np.array(efforts), np.array(together), modes, found)


def _force_between(simulation: Simulation) -> float:
    """The normal forces in N between the two, of the last engine step."""
    one, other = (cast(Any, each._body) for each in simulation.characters)
    if isinstance(one, MujocoBody):
        data, first = one._world.data, other.place.links.start
        bodies = one._world.model.geom_bodyid[data.contact.geom]
        # the second one's links come last, the ground first
        between = (bodies.min(axis=1) > 0) & (bodies.min(axis=1) < first)
        between &= bodies.max(axis=1) >= first
        return float(data.efc_force[data.contact.efc_address[between]].sum())
    points = pybullet.getContactPoints(
        bodyA=one._body, bodyB=other._body, physicsClientId=one._client
    )
    return sum(point[9] for point in points)
