"""Makes the simulation that the parameters of `sim_node` say."""

from dataclasses import replace

from msgs_config.character.model import Character
from msgs_config.parameters import Values
from msgs_config.shared_parameters import NO_GROUND, PLANE
from msgs_config.terrain.file import read_terrain
from sim_node.initial_state import CharacterSettings
from sim_node.parameters import SimulatorParameters
from sim_node.physics.settings import SimulationSettings
from sim_node.physics.simulated_character import CharacterSetup
from sim_node.physics.simulation import Simulation


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
    own = CharacterSettings.of(values)
    return CharacterSetup(
        character=character,
        commanded_joints=own.commanded_joints,
        initial_position=own.initial_position,
        initial_velocity=own.initial_velocity,
        name=name,
        mass_factors=own.mass_factors,
    )


def make_simulation_settings(values: Values) -> SimulationSettings:
    """The settings of the simulation that the parameters' values say.

    Raises:
        CharacterError: the terrain's URDF cannot be read.
    """
    settings = SimulationSettings.of(values)
    on_plane, in_air = settings.terrain == PLANE, settings.terrain == NO_GROUND
    world = replace(
        settings.world,
        step_s=settings.step_s,
        ground=on_plane,
        terrain=None if on_plane or in_air else read_terrain(settings.terrain),
    )
    return replace(settings, world=world)
