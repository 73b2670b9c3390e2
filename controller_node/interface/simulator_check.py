"""Whether a simulator is what a controller was made for."""

from controller_node.controller import Controller
from controller_node.ground import NO_FILE, GroundSettings
from controller_node.parameters import check_world
from msgs_config.character.meshes.resolving import collision_meshes
from msgs_config.character.model import Character
from msgs_config.errors import CharacterError, ConfigurationError
from msgs_config.messages.configuration import RunConfiguration
from msgs_config.parameters import Values
from msgs_config.terrain.file import read_terrain


def check_simulator(
    controller: Controller, character: Character, values: Values, simulator: RunConfiguration
) -> None:
    """Raise an error if a simulator simulates something else than a controller was made for."""
    if simulator.probe is None:
        return
    if simulator.layout.dof_names != character.layout.dof_names:
        raise CharacterError(
            f"the simulator's character '{simulator.character}' has other degrees of freedom "
            f"than '{character.name}'; set 'character' to the simulator's"
        )
    controller.check_agreement(simulator.probe)
    check_world(values, simulator.parameters)
    _check_terrain(GroundSettings.of(values).terrain, simulator)
    for name in ("rate", "placement"):
        its, own = simulator.parameters.get(name), values[name]
        if its != own:
            raise ConfigurationError(
                f"the simulator's parameter '{name}' is {its}, the controller's is {own}; "
                "they must be the same"
            )


def _check_terrain(own: str, simulator: RunConfiguration) -> None:
    """Raise an error if a controller knows another terrain, by its pieces, than a simulator has."""
    if own in NO_FILE:
        return
    known, its = read_terrain(own, NO_FILE), simulator.terrain
    if its is None or (known.urdf_text, collision_meshes(known)) != (its.text, its.meshes):
        raise ConfigurationError(
            f"the controller's parameter 'terrain' is {own}, which is not what the simulator has, "
            f"{simulator.parameters.get('terrain')}; they must be the same"
        )
