"""A parameter's value is right or wrong in the same way everywhere, and says why."""

import math
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller_node import parameters as controller_parameters
from msgs_config.character.file import shipped_characters
from msgs_config.character.layout import ROOT
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError
from msgs_config.parameters import Parameter, Values, resolve
from sim_node import parameters as sim_parameters
from sim_node.simulation_factory import make_character_setup
from tests.support.urdf import link, robot, write_character

FLAG = Parameter("flag", True, "a flag")
COUNT = Parameter("count", 3, "a count", minimum=1, maximum=10)
SPEED = Parameter("speed", 1.5, "a speed", unit="m/s", minimum=-2.0, maximum=2.0)
TEXT = Parameter("text", "walk", "a text")
CHOICE = Parameter("choice", "hold", "a choice", choices=("hold", "zero"))
NAMES = Parameter("names", ["knee"], "names")
NUMBERS = Parameter("numbers", [0.0], "numbers", minimum=-1.0, maximum=1.0)
UNBOUNDED = Parameter("limit", 1.0, "a limit", maximum=math.inf)
KINDS = [FLAG, COUNT, SPEED, TEXT, CHOICE, NAMES, NUMBERS]


# One value


@pytest.mark.parametrize(
    ("parameter", "value"),
    [
        (FLAG, False),
        (COUNT, 1),
        (COUNT, 10),
        (SPEED, -2.0),
        (SPEED, 2.0),
        (SPEED, -0.5),
        (TEXT, ""),
        (TEXT, "größer"),
        (CHOICE, "zero"),
        (NAMES, []),
        (NAMES, ["hip", "hip"]),
        (NUMBERS, []),
        (NUMBERS, [-1.0, 0.5, 1.0]),
        (UNBOUNDED, math.inf),
    ],
)
def test_a_value_of_the_right_type_within_the_bounds_stays_as_it_is(
    parameter: Parameter, value: object
) -> None:
    checked = parameter.checked(value)

    assert checked == value
    assert type(checked) is type(value)


@pytest.mark.parametrize(
    ("parameter", "value", "right"),
    [
        (FLAG, 1, "true or false"),
        (FLAG, "true", "true or false"),
        (FLAG, None, "true or false"),
        (COUNT, True, "a whole number"),
        (COUNT, 3.0, "a whole number"),
        (COUNT, "3", "a whole number"),
        (SPEED, True, "a number"),
        (SPEED, "1.0", "a number"),
        (SPEED, [1.0], "a number"),
        (TEXT, 1, "a text"),
        (TEXT, None, "a text"),
        (TEXT, ["walk"], "a text"),
        (NAMES, "knee", "a list"),
        (NAMES, ["knee", 1], "a text"),
        (NUMBERS, 0.5, "a list"),
        (NUMBERS, [0.5, True], "a number"),
        (NUMBERS, [0.5, "0.5"], "a number"),
        (NUMBERS, {"x": 0.5}, "a list"),
    ],
)
def test_a_value_of_another_type_is_refused_with_name_value_and_type(
    parameter: Parameter, value: object, right: str
) -> None:
    with pytest.raises(ConfigurationError) as caught:
        parameter.checked(value)

    assert f"'{parameter.name}'" in str(caught.value)
    assert f"it must be {right}" in str(caught.value)


@pytest.mark.parametrize("value", [-1, 0, 1])
def test_a_whole_number_is_a_fine_float(value: int) -> None:
    checked, checked_list = SPEED.checked(value), NUMBERS.checked((value, 0.5))

    assert (checked, checked_list) == (value, [value, 0.5])
    assert type(checked) is float
    assert isinstance(checked_list, list) and type(checked_list[0]) is float


@pytest.mark.parametrize(
    ("parameter", "value", "bounds"),
    [
        (COUNT, 0, "1 to 10"),
        (COUNT, 11, "1 to 10"),
        (SPEED, math.nextafter(2.0, 3.0), "-2 to 2 m/s"),
        (SPEED, -3, "-2 to 2 m/s"),
        (SPEED, math.inf, "-2 to 2 m/s"),
        (SPEED, -math.inf, "-2 to 2 m/s"),
        (SPEED, math.nan, "-2 to 2 m/s"),
        (UNBOUNDED, math.nan, "0 to inf"),
        (UNBOUNDED, -1.0, "0 to inf"),
        (NUMBERS, [0.0, 1.5], "-1 to 1"),
        (NUMBERS, [math.nan], "-1 to 1"),
    ],
)
def test_a_value_out_of_bounds_is_refused_with_the_bounds_and_the_unit(
    parameter: Parameter, value: object, bounds: str
) -> None:
    with pytest.raises(ConfigurationError) as caught:
        parameter.checked(value)

    assert f"'{parameter.name}'" in str(caught.value)
    assert str(caught.value).endswith(f"it must be {bounds}")


@pytest.mark.parametrize("value", [10**400, -(10**400)], ids=["huge", "minus huge"])
@pytest.mark.parametrize("parameter", [COUNT, SPEED, UNBOUNDED], ids=lambda kind: kind.name)
def test_a_whole_number_beyond_every_float_is_refused(parameter: Parameter, value: int) -> None:
    with pytest.raises(ConfigurationError, match=parameter.name):
        parameter.checked(value)


def test_a_value_that_is_no_choice_is_refused_with_the_choices() -> None:
    with pytest.raises(ConfigurationError) as caught:
        CHOICE.checked("abort")

    for word in ("'choice'", "'abort'", "hold, zero"):
        assert word in str(caught.value)


anything = st.recursive(
    st.one_of(
        st.none(),
        st.booleans(),
        st.integers(-20, 20),
        st.floats(),
        st.text(max_size=5),
        st.binary(),
    ),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(st.text(), inner)),
    max_leaves=4,
)


@settings(max_examples=200, deadline=None)
@given(st.sampled_from(KINDS), anything)
def test_any_value_is_taken_in_the_parameters_type_or_refused_by_name(
    parameter: Parameter, value: object
) -> None:
    try:
        checked = parameter.checked(value)
    except ConfigurationError as error:
        assert f"'{parameter.name}'" in str(error)
        assert "\n" not in str(error)
    else:
        assert type(checked) is type(parameter.default)
        assert checked == (list(value) if isinstance(value, tuple) else value)
        assert parameter.checked(checked) == checked


# All values of a node


def test_what_is_given_replaces_the_default() -> None:
    values = resolve(KINDS, {"count": 7, "speed": 2, "names": ("hip", "knee")})

    assert values == {
        "flag": True,
        "count": 7,
        "speed": 2.0,
        "text": "walk",
        "choice": "hold",
        "names": ["hip", "knee"],
        "numbers": [0.0],
    }


def test_whole_numbers_become_floats_where_the_parameter_is_one() -> None:
    values = resolve(KINDS, {"speed": 2, "numbers": [1, 0.5]})

    assert (values.number("speed"), values["numbers"]) == (2.0, [1.0, 0.5])
    assert [type(each) for each in (values["speed"], *values["numbers"])] == [float] * 3


def test_an_unknown_parameter_is_refused_with_those_that_exist() -> None:
    with pytest.raises(ConfigurationError) as caught:
        resolve(KINDS, {"cuont": 7})

    assert "'cuont'" in str(caught.value)
    assert "choice, count, flag, names, numbers, speed, text" in str(caught.value)


@pytest.mark.parametrize("name", ["use_sim_time", "start_type_description_service"])
def test_parameters_that_ros_gives_every_node_are_left_to_ros(name: str) -> None:
    assert name not in resolve(KINDS, {name: True})


# The parameters of both nodes


@pytest.fixture(scope="module", params=shipped_characters())
def character(request: pytest.FixtureRequest) -> Character:
    return load_character(request.param)


def sim_node_parameters(character: Character) -> list[Parameter]:
    return sim_parameters.PARAMETERS + sim_parameters.character_parameters(character)


def controller_node_parameters(character: Character) -> list[Parameter]:
    return controller_parameters.PARAMETERS + controller_parameters.character_parameters(character)


NODES = [sim_node_parameters, controller_node_parameters]


@pytest.mark.parametrize("of_node", NODES)
def test_each_parameter_is_declared_once_with_a_line_bounds_and_a_default_within_them(
    of_node: Callable[[Character], list[Parameter]], character: Character
) -> None:
    parameters = of_node(character)

    names = [parameter.name for parameter in parameters]
    assert len(set(names)) == len(names)
    for parameter in parameters:
        assert len(parameter.description) >= 5, parameter.name
        assert "\n" not in parameter.description
        assert parameter.minimum < parameter.maximum, parameter.name
        assert parameter.checked(parameter.default) == parameter.default, parameter.name


@pytest.mark.parametrize("name", ["character", "rate", "gravity"])
def test_what_both_nodes_must_agree_on_has_one_default(name: str) -> None:
    sim = {parameter.name: parameter for parameter in sim_parameters.PARAMETERS}
    controller = {parameter.name: parameter for parameter in controller_parameters.PARAMETERS}

    assert sim[name].default == controller[name].default
    assert (sim[name].minimum, sim[name].maximum) == (
        controller[name].minimum,
        controller[name].maximum,
    )


def test_the_defaults_of_one_node_are_a_simulation(character: Character) -> None:
    values = resolve(sim_node_parameters(character), {})

    made = make_character_setup(character, values)

    assert made.commanded_joints == tuple(character.layout.actuated_joint_names)
    assert made.initial_position == character.rest_position
    assert len(made.initial_velocity) == character.layout.size


def test_the_commanded_joints_of_a_character_without_motors_may_be_its_base(
    tmp_path: Path,
) -> None:
    box = load_character(str(write_character(tmp_path, robot(link("box")))))
    parameters = sim_node_parameters(box)

    values = resolve(parameters, {"commanded_joints": [ROOT]})

    assert isinstance(values, Values)
    assert values["commanded_joints"] == [ROOT]
