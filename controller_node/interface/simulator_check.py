"""Whether a simulator is what a controller was made for."""

from controller_node.controller import Controller
from controller_node.parameters import check_world
from msgs_config.character.model import Character
from msgs_config.errors import CharacterError, ConfigurationError
from msgs_config.messages.configuration import RunConfiguration
from msgs_config.parameters import Values


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
    for name in ("rate", "placement"):
        its, own = simulator.parameters.get(name), values[name]
        if its != own:
            raise ConfigurationError(
                f"the simulator's parameter '{name}' is {its}, the controller's is {own}; "
                "they must be the same"
            )
