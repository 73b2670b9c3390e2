"""What is said to be a simulator's configuration is one, or is refused."""

import json

import pytest

from controller_node.parameters import PARAMETERS
from msgs_config.errors import MessageError
from msgs_config.messages import configuration
from msgs_config.parameters import resolve
from tests.support.physics import character


@pytest.mark.parametrize("parameters", ["text", [1], 5, None])
def test_parameters_that_are_no_mapping_are_refused(parameters: object) -> None:
    described = configuration.describe(character("pendulum"), resolve(PARAMETERS, {}))
    content = json.loads(described)

    with pytest.raises(MessageError, match="not a simulator's configuration"):
        configuration.parse(json.dumps(content | {"parameters": parameters}))


def test_of_both_names_of_a_parameter_one_counts() -> None:
    described = configuration.describe(character("pendulum"), resolve(PARAMETERS, {}))
    content = json.loads(described)
    content["parameters"] |= {"balance": True}

    assert "balance" not in configuration.parse(json.dumps(content)).parameters
