"""Numbers as people and programs write them: the same in `--set`, character and keyframe files."""

import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from actuated_characters.commands.common.settings import node_settings
from controller_node.references.files.keyframes import read_keyframes
from msgs_config.character.file import read_character_file
from msgs_config.character.loading import load_character
from msgs_config.errors import CharacterError, ConfigurationError
from msgs_config.files import dump_yaml, parse_yaml
from msgs_config.parameters import Parameter, resolve
from tests.support.urdf import joint, link, robot

WRITTEN = {
    "1e-1": 0.1,
    "1e2": 100.0,
    "-1E+3": -1000.0,
    "+1.5e0": 1.5,
    ".5": 0.5,
    "-.5e1": -5.0,
    "1.": 1.0,
    "2.5": 2.5,
    "7": 7.0,
    "-0": 0.0,
    "010": 10.0,  # not eight
}
NO_NUMBERS = ["0x10", "0o7", "0b1", "1_000", "1:30", "e1", "1e", "1e1.5", "--1", "nan", "inf"]
NUMBER = Parameter("x", 0.0, "a number", minimum=-1.8e308, maximum=1.8e308)
ARM = robot(link("a"), link("b"), joint("swing", "a", "b", "continuous", '<axis xyz="0 1 0"/>'))
FORMS = (repr, "{:e}".format, "{:.17E}".format, "{:.3e}".format, json.dumps)
FLOATS = st.floats(allow_nan=False, allow_infinity=False)


def by_set(text: str) -> object:
    """What `--set` makes of a parameter's value."""
    given = node_settings([f"sim_node.x:={text}"], ["sim_node", "controller_node"])
    return resolve([NUMBER], given["sim_node"])["x"]


@pytest.fixture(scope="module")
def directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("numbers")
    (path / "arm.urdf").write_text(ARM)
    return path


def by_character_file(directory: Path, text: str) -> float:
    """What a character's file makes of a number."""
    file = directory / "arm.yaml"
    file.write_text(f"urdf: arm.urdf\nrest_pose: {{swing: {text}}}\n")
    return read_character_file(str(file)).rest_pose["swing"]


def by_keyframes(directory: Path, text: str) -> float:
    """What a file of keyframes makes of a number."""
    file = directory / "moves.yaml"
    file.write_text(f"keyframes: [{{time: 0, pose: {{swing: {text}}}}}]\n")
    arm = load_character(str(directory / "arm.urdf"))
    return float(read_keyframes(arm, str(file)).configurations.position[0, -1])


@pytest.mark.parametrize("text", WRITTEN)
def test_a_number_is_the_same_everywhere(directory: Path, text: str) -> None:
    assert by_set(text) == WRITTEN[text]
    assert by_character_file(directory, text) == WRITTEN[text]
    assert by_keyframes(directory, text) == WRITTEN[text]


@pytest.mark.parametrize("text", NO_NUMBERS)
def test_what_is_no_decimal_number_is_refused(directory: Path, text: str) -> None:
    with pytest.raises(ConfigurationError, match=r"'x' is .*; it must be a number"):
        by_set(text)
    with pytest.raises(CharacterError, match=r"rest_pose.swing is .*; it must be a finite number"):
        by_character_file(directory, text)


@pytest.mark.parametrize("text", [".inf", "-.inf", ".nan", "1e999"])
def test_what_is_not_finite_is_refused(directory: Path, text: str) -> None:
    with pytest.raises(CharacterError, match="it must be a finite number"):
        by_character_file(directory, text)
    with pytest.raises(ConfigurationError, match="'x' is "):
        resolve(
            [Parameter("x", 0.0, "bounded", minimum=-1.0, maximum=1.0)],
            node_settings([f"sim_node.x:={text}"], ["sim_node"])["sim_node"],
        )


@given(value=FLOATS, form=st.sampled_from(FORMS))
@settings(deadline=None, max_examples=50)
def test_what_programs_write_is_read_to_the_bit(
    directory: Path, value: float, form: Callable[[float], str]
) -> None:
    text = form(value)
    assert same(by_set(text), float(text))
    if math.isfinite(float(text)):  # the largest ones, rounded up, are not
        assert same(by_character_file(directory, text), float(text))
    if abs(float(text)) <= 1e6:
        assert same(by_keyframes(directory, text), float(text))


def same(value: object, wanted: float) -> bool:
    """Whether a value is this float to the bit."""
    return type(value) is float and value.hex() == wanted.hex()


TEXTS = ["2024-01-01", "12:30:00", "=", "<<", "1e5x", "0x1p3", "y", "n", "noon", "nullify"]


@pytest.mark.parametrize("text", TEXTS)
def test_any_other_plain_word_is_a_text(text: str) -> None:
    assert parse_yaml("here", text, ConfigurationError) == text


PLAIN = {"yes": True, "Off": False, "true": True, "~": None, "": None, "null": None, "12": 12}


@pytest.mark.parametrize("text", PLAIN)
def test_flags_and_whole_numbers_are_as_ever(text: str) -> None:
    value = parse_yaml("here", text, ConfigurationError)
    assert value == PLAIN[text]
    assert type(value) is type(PLAIN[text])


HOSTILE = ["[" * 1000, "0" * 5000, "!!python/name:os.system", "!!int 0x1f", "a: [", "- " * 500]


@pytest.mark.parametrize("text", HOSTILE)
def test_a_value_of_set_that_is_no_yaml_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(ConfigurationError, match="not valid YAML") as caught:
        by_set(text)
    assert "\n" not in str(caught.value)


_PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(st.characters(codec="ascii")),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=10,
)


@pytest.mark.slow
@given(st.dictionaries(st.sampled_from(["topics", "duration", "1", "no"]), _PLAIN))
@settings(max_examples=100, deadline=None)
def test_yaml_is_written_such_that_others_read_the_same(content: dict[str, object]) -> None:
    read = yaml.load(dump_yaml(content), Loader=yaml.SafeLoader)

    assert json.dumps(read) == json.dumps(content)
