"""The parameters of `sim_node` name one character or several, and the ground that they stand on."""

from pathlib import Path

import numpy as np
import pytest

from msgs_config.character.model import Character
from msgs_config.errors import ActuatedCharactersError, CharacterError, ConfigurationError
from sim_node.parameters import (
    CHARACTERS,
    WORLD_PARAMETERS,
    load_parameters,
    resolve_alone,
)
from sim_node.simulation_factory import make_simulation_settings
from tests.support.physics import (
    FLOATING_TURNED_FRAMES,
    box_character,
    character,
    joint_simulation,
    simulation,
)

OWN = [
    "character",
    "collision",
    "placement",
    "mass_factors",
    "commanded_joints",
    "initial_state",
    "initial_position",
    "initial_velocity",
]
WORLD = [CHARACTERS.name, *(parameter.name for parameter in WORLD_PARAMETERS)]
SLOPE = """
<robot name="ramp"><link name="ramp">
  <collision><origin xyz="0 0 {height}"/><geometry><box size="20 20 1"/></geometry></collision>
</link></robot>
"""


# --- one -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"characters": []},
        {"character": "franka_panda", "rate": 480, "gravity": 1.62},
        {"character": "lift", "initial_position": [2], "commanded_joints": ["height"]},
        {"character": "pendulum", "placement": [1.0, 2.0, 3.0, 0.0], "use_sim_time": True},
    ],
)
def test_without_names_there_is_one_character_whose_parameters_have_no_prefix(
    given: dict[str, object],
) -> None:
    whole = character(str(given.get("character", "humanoid")))
    own = {name: value for name, value in given.items() if name != "characters"}
    alone = resolve_alone(whole, own)

    loaded = load_parameters(given)

    (one,) = loaded.characters
    assert (one.name, one.prefix, one.character.name) == ("", "", whole.name)
    assert one.values == alone
    assert loaded.values == {**alone, "characters": []}
    assert [parameter.name for parameter in loaded.declared] == [*WORLD, *OWN]
    defaults = {parameter.name: parameter.default for parameter in loaded.declared}
    assert defaults["commanded_joints"] == whole.layout.actuated_joint_names
    assert defaults["initial_velocity"] == [0.0] * whole.layout.size


def test_what_is_made_of_the_parameters_is_the_simulation_of_the_one() -> None:
    given: dict[str, object] = {"rate": 100, "initial_position": [2.0]}
    with (
        joint_simulation({"character": "lift", **given}) as loaded,
        simulation("lift", **given) as run,
    ):
        loaded.step([np.ones(1)])
        run.advance(np.ones(1))

        (simulated,) = loaded.characters
        assert loaded.settings == run.settings
        assert simulated.setup.prefix == ""
        assert simulated.state.position.tobytes() == run.state.position.tobytes()


# --- several -------------------------------------------------------------------------------------


def test_each_name_is_a_character_with_parameters_of_its_own() -> None:
    loaded = load_parameters(
        {"characters": ["one", "arm"], "arm.character": "franka_panda", "rate": 100}
    )

    assert loaded.names == ("one", "arm")
    assert [each.character.name for each in loaded.characters] == ["humanoid", "franka_panda"]
    own = [f"{name}.{parameter}" for name in ("one", "arm") for parameter in OWN]
    assert [parameter.name for parameter in loaded.declared] == [*WORLD, *own]
    assert list(loaded.values) == [*WORLD, *own]
    assert loaded.values["rate"] == loaded.characters[1].values["rate"] == 100
    assert loaded.values["characters"] == ["one", "arm"]
    assert loaded.values["arm.character"] == "franka_panda"
    assert loaded.values["arm.initial_position"] == list(character("franka_panda").rest_position)
    for parameter in loaded.declared:
        assert parameter.checked(parameter.default) == parameter.default, parameter.name


@pytest.mark.parametrize("reverse", [False, True])
def test_what_is_given_without_a_name_is_for_all_that_have_nothing_of_their_own(
    reverse: bool,
) -> None:
    given = {
        "two.character": "pendulum",
        "character": "lift",
        "characters": ["one", "two", "three"],
        "initial_velocity": [0.5],
        "three.initial_velocity": [0.25],
    }

    loaded = load_parameters(dict(reversed(given.items())) if reverse else given)

    assert [each.character.name for each in loaded.characters] == ["lift", "pendulum", "lift"]
    velocities = [each.values["initial_velocity"] for each in loaded.characters]
    assert velocities == [[0.5], [0.5], [0.25]]
    assert loaded.values["one.initial_velocity"] == [0.5]


def test_a_placement_moves_the_rest_pose_that_a_character_begins_in() -> None:
    loaded = load_parameters(
        {"characters": ["one", "two"], "two.placement": [1.0, 2.0, 0.5, np.pi / 2]}
    )

    # turned about z at the world's origin, then moved
    one, two = (each.values["initial_position"] for each in loaded.characters)
    assert one == list(character("humanoid").rest_position)
    x, y, z = one[:3]
    np.testing.assert_allclose(two[:3], [1.0 - y, 2.0 + x, 0.5 + z], atol=1e-12)
    assert two[6:] == one[6:]


def test_names_may_be_short_long_and_of_any_case_and_one_file_several_characters() -> None:
    names = ["a", "B2", "left_One", "x" * 40]

    loaded = load_parameters({"characters": names, "character": FLOATING_TURNED_FRAMES})

    assert list(loaded.names) == names
    assert loaded.characters[0].character == loaded.characters[1].character


NAMES = ["", "1st", "_one", "one two", "one/two", "one.two", "~", "größer", "one\n", "one-two"]


@pytest.mark.parametrize(
    ("names", "why"),
    [
        *(([name], "parameter 'characters' has") for name in NAMES),
        (["one", ""], "parameter 'characters' has ''"),
        (["one", "one"], "'one'; it must list different names"),
        (["one", "two", "one"], "'one'; it must list different names"),
        *((wrong, "'characters'") for wrong in ("one", [1], None, [["one"]], {"one": 1})),
    ],
)
def test_names_that_cannot_be_namespaces_are_refused(names: object, why: str) -> None:
    with pytest.raises(ConfigurationError, match=why) as caught:
        load_parameters({"characters": names})

    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("names", "unknown"),
    [
        *(([], name) for name in ("one.character", "one.initial_position", ".character", "a.b.c")),
        *(
            (["one", "two"], name)
            for name in ("three.character", "three.initial_position", "On.character")
        ),
        *((["one", "two"], name) for name in ("one.", "one.cuont", "one.one.character", "one")),
        *((["one", "two"], f"one.{name}") for name in WORLD),
    ],
)
def test_a_parameter_of_nothing_that_there_is_is_refused(names: list[str], unknown: str) -> None:
    own = unknown.removeprefix("one.") if names else unknown
    defaults = {p.name: p.default for p in [CHARACTERS, *WORLD_PARAMETERS]}

    with pytest.raises(ConfigurationError, match=f"unknown parameter .*{own}'"):
        load_parameters({"characters": names, unknown: defaults.get(own, "lift")})


@pytest.mark.parametrize(
    ("parameter", "value", "why"),
    [
        ("initial_velocity", ["fast"], "'initial_velocity'"),
        *(
            ("placement", value, "'placement'")
            for value in ([], [1.0] * 3, [0.0] * 5, "here", [0.0, 0.0, 0.0, "x"], [np.nan] * 4)
        ),
        ("cuont", 1, "'cuont'"),
    ],
)
def test_a_wrong_value_is_refused_and_names_the_character(
    parameter: str, value: object, why: str
) -> None:
    with pytest.raises(ConfigurationError, match=rf"^(?!character).*{why}"):
        load_parameters({parameter: value})
    with pytest.raises(ConfigurationError, match=rf"character 'two': .*{why}"):
        load_parameters({"characters": ["one", "two"], f"two.{parameter}": value})


@pytest.mark.parametrize("given", [{}, {"characters": ["one"]}])
def test_a_character_that_does_not_exist_is_refused_with_those_that_do(
    given: dict[str, object],
) -> None:
    with pytest.raises(ActuatedCharactersError, match="franka_panda, humanoid"):
        load_parameters({**given, "character": "dragon"})


# --- terrain -------------------------------------------------------------------------------------


@pytest.fixture
def box(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Character:
    """A box 0.2 m high, in the working directory, with a plate whose surface is at a height."""
    monkeypatch.chdir(tmp_path)
    for height in (-0.2, 0.0, 0.3):
        (tmp_path / f"{height}.urdf").write_text(SLOPE.format(height=height - 0.5))
    return box_character(tmp_path, "0.4 0.4 0.2")


@pytest.mark.parametrize("resets", [0, 1])
@pytest.mark.parametrize(
    ("terrain", "height"),
    [
        ("plane", 0.0),
        ("{here}/-0.2.urdf", -0.2),
        ("0.3.urdf", 0.3),
        ("package://pybullet_data/plane.urdf", 0.0),
    ],
)
def test_what_stands_in_the_world_stands_on_its_terrain(
    box: Character, tmp_path: Path, terrain: str, height: float, resets: int
) -> None:
    given = {"terrain": terrain.format(here=tmp_path), "initial_position": [0, 0, 1, 0, 0, 0]}
    with joint_simulation({"character": str(box.file), **given}) as run:
        for _ in range(resets):
            run.reset()
        for _ in range(480):
            run.step([np.zeros(6)])

        assert run.characters[0].state.position[2] == pytest.approx(height + 0.1, abs=5e-3)


def test_without_terrain_everything_falls_forever(box: Character) -> None:
    step, given = 1.0 / 240.0, {"terrain": "none", "initial_position": [0, 0, 1, 0, 0, 0]}
    with joint_simulation({"character": str(box.file), **given}) as run:
        for _ in range(480):
            run.step([np.zeros(6)])

        fallen = 9.81 * step**2 * 480 * 481 / 2.0
        assert run.characters[0].state.position[2] == pytest.approx(1.0 - fallen, abs=1e-9)


@pytest.mark.parametrize(("friction", "slides"), [(0.0, True), (2.0, False)])
def test_the_grounds_friction_is_the_terrain_files_too(
    box: Character, friction: float, slides: bool
) -> None:
    given = {
        "character": str(box.file),
        "terrain": "0.0.urdf",
        "friction": friction,
        "initial_position": [0.0, 0.0, 0.1, 0.0, 0.0, 0.0],
        "initial_velocity": [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    }
    with joint_simulation(given) as run:
        for _ in range(240):
            run.step([np.zeros(6)])
        speed = run.characters[0].state.velocity[0]

    assert speed == pytest.approx(1.0 if slides else 0.0, abs=1e-2)


BOX = '<link name="a"><collision><geometry><box size="1 x 1"/></geometry></collision></link>'
BROKEN = [
    "",
    "no xml",
    "<robot/>",
    '<robot><link name="a"/><link name="b"/></robot>',
    f'<robot name="x">{BOX}</robot>',
]


@pytest.mark.parametrize(
    ("terrain", "text", "why"),
    [
        ("moon.urdf", None, "moon.urdf"),
        ("Plane", None, "Plane"),
        ("", None, "unknown terrain ''; there are: plane, none, rubble"),
        ("package://no_such_package/moon.urdf", None, "no_such_package"),
        ("/dev/null", None, "not a file"),
        *(("broken.urdf", text, r"broken\.urdf") for text in BROKEN),
    ],
)
def test_a_terrain_that_is_not_there_or_no_sound_urdf_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, terrain: str, text: str | None, why: str
) -> None:
    monkeypatch.chdir(tmp_path)
    if text is not None:
        (tmp_path / terrain).write_text(text)
    values = load_parameters({"character": "lift", "terrain": terrain}).values

    with pytest.raises(CharacterError, match=why) as caught:
        make_simulation_settings(values)

    assert "\n" not in str(caught.value)
