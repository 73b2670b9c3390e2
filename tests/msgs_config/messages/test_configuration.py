"""What is said to be a simulator's configuration is one, or is refused."""

import json

import pytest

from controller_node.parameters import PARAMETERS, resolve_for
from msgs_config.character.file import shipped_characters
from msgs_config.errors import MessageError
from msgs_config.messages import configuration
from msgs_config.parameters import resolve
from sim_node import parameters as simulator
from tests.support.physics import character


@pytest.mark.parametrize("parameters", ["text", [1], 5, None])
def test_parameters_that_are_no_mapping_are_refused(parameters: object) -> None:
    described = configuration.describe(character("pendulum"), resolve(PARAMETERS, {}))
    content = json.loads(described)

    with pytest.raises(MessageError, match="not a simulator's configuration"):
        configuration.parse(json.dumps(content | {"parameters": parameters}))


@pytest.mark.parametrize("name", shipped_characters())
def test_a_configuration_is_json_that_any_language_reads_and_says_the_same(name: str) -> None:
    whole = character(name)
    values = simulator.resolve_alone(whole, {"session": "/a#1"})
    of_controller = resolve_for(whole, {})

    text = configuration.describe(whole, values, session="/b#2")

    json.loads(text, parse_constant=pytest.fail)  # JSON knows no Infinity and no NaN
    known = configuration.parse(text)
    assert known.layout.dof_names == whole.layout.dof_names
    assert known.effort_limits.tolist() == whole.effort_limits().tolist()
    del values["session"]  # which is of no influence
    assert known.parameters == values
    assert known.session == "/b#2"
    text = configuration.describe(whole, of_controller)
    assert json.loads(text, parse_constant=pytest.fail)["character"] == name
