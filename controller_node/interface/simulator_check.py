"""Whether a simulator is what a controller was made for."""

from controller_node.controller_setups import ControllerSetup
from controller_node.ground import check_pieces
from controller_node.parameters import check_world
from msgs_config.character.model import Character, UrdfOptions
from msgs_config.character.terrain import pieces_of
from msgs_config.errors import CharacterError, ConfigurationError
from msgs_config.messages.configuration import RunConfiguration


def check_simulator(
    setup: ControllerSetup, character: Character, simulator: RunConfiguration
) -> None:
    """Raise an error if a simulator simulates something else than a controller was made for."""
    if simulator.probe is None:
        return
    if simulator.layout.dof_names != character.layout.dof_names:
        raise CharacterError(
            f"the simulator's character '{simulator.character}' has other degrees of freedom "
            f"than '{character.name}'; set 'character' to the simulator's"
        )
    setup.controller.check_agreement(simulator.probe)
    check_world(setup.values, simulator.parameters)
    _check_terrain(setup, simulator)
    for name in ("rate", "placement"):
        its, own = simulator.parameters.get(name), setup.values[name]
        if its != own:
            raise ConfigurationError(
                f"the simulator's parameter '{name}' is {its}, the controller's is {own}; "
                "they must be the same"
            )


def _check_terrain(setup: ControllerSetup, simulator: RunConfiguration) -> None:
    its = simulator.terrain
    if setup.terrain and its:
        pieces = pieces_of(UrdfOptions(its.path, its.text, fixed_base=True), its.meshes)
        check_pieces(setup.values, setup.terrain, simulator.parameters, pieces)
