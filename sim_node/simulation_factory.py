"""Makes the simulation that the parameters of `sim_node` say."""

from dataclasses import replace
from pathlib import Path

from msgs_config import files
from msgs_config.character.model import Character, UrdfOptions
from msgs_config.character.urdf.check import check_urdf
from msgs_config.character.urdf.file_formats.source import read_urdf_text
from msgs_config.errors import CharacterError
from msgs_config.parameters import Values
from msgs_config.shared_parameters import NO_GROUND, PLANE
from sim_node.initial_state import POSITION, VELOCITY
from sim_node.parameters import SimulatorParameters
from sim_node.physics.simulated_character import CharacterSetup
from sim_node.physics.simulation import Simulation, SimulationSettings
from sim_node.physics.world import WorldSettings
from sim_node.world_parameters import CONTACT_BREAKING_THRESHOLD


def make_simulation(parameters: SimulatorParameters) -> Simulation:
    """The simulation of all characters.

    Raises:
        CharacterError: the engine rejects a character, or the terrain's URDF cannot be read.
    """
    setups = [
        make_character_setup(each.character, each.values, each.name)
        for each in parameters.characters
    ]
    return Simulation(setups, make_simulation_settings(parameters.values))


def make_character_setup(character: Character, values: Values, name: str = "") -> CharacterSetup:
    """The character's part in the simulation that the parameters' values say."""
    return CharacterSetup(
        character=character,
        commanded_joints=values.texts("commanded_joints"),
        initial_position=values.numbers(POSITION),
        initial_velocity=values.numbers(VELOCITY),
        name=name,
    )


def make_simulation_settings(values: Values) -> SimulationSettings:
    """The settings of the simulation that the parameters' values say.

    Raises:
        CharacterError: the terrain's URDF cannot be read.
    """
    rate, substeps = values.integer("rate"), values.integer("substeps")
    terrain, lifetime = values.text("terrain"), values.number("ball_lifetime")
    return SimulationSettings(
        rate_hz=rate,
        substeps=substeps,
        speed_limit=values.number("speed_limit"),
        command_delay_ticks=values.integer("command_delay_ticks"),
        ball_ticks=max(round(lifetime * rate), 1) if lifetime else 0,
        world=change_world(
            WorldSettings(
                step_s=1.0 / (rate * substeps),
                ground=terrain == PLANE,
                terrain=None if terrain in (PLANE, NO_GROUND) else _read_terrain(terrain),
            ),
            values,
        ),
    )


def change_world(world: WorldSettings, values: Values) -> WorldSettings:
    """A world's settings with those of the parameters' values that may change at a reset."""
    return replace(
        world,
        gravity=values.number("gravity"),
        friction=values.number("friction"),
        link_friction=values.number("link_friction"),
        solver_iterations=values.integer("solver_iterations"),
        contact_breaking_threshold=values.number(CONTACT_BREAKING_THRESHOLD),
    )


def _read_terrain(path: str) -> UrdfOptions:
    urdf = files.resolve(path, Path.cwd(), CharacterError)
    text = read_urdf_text(urdf).text
    check_urdf(urdf, text)
    return UrdfOptions(urdf, text, fixed_base=True)
