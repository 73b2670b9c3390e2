"""The parameters of `sim_node` name one character or several, and the ground that they stand on."""

from pathlib import Path

import numpy as np
import pytest

from msgs_config.errors import ActuatedCharactersError, CharacterError, ConfigurationError
from msgs_config.parameters import resolve
from sim_node.parameters import (
    CHARACTERS,
    PARAMETERS,
    WORLD_PARAMETERS,
    SimulatorParameters,
    character_parameters,
    load_parameters,
    make_character_setup,
    make_settings,
)
from tests.support.physics import FLOATING_TURNED_FRAMES, character, joint_simulation, simulation

HUMANOID = character("humanoid").layout
OWN = [
    "character",
    "placement",
    "commanded_joints",
    "initial_state",
    "initial_position",
    "initial_velocity",
]
SLOPE = """
<robot name="ramp"><link name="ramp">
  <collision><origin xyz="0 0 {height}"/><geometry><box size="20 20 1"/></geometry></collision>
</link></robot>
"""


def declared_names(cast: SimulatorParameters) -> list[str]:
    return [parameter.name for parameter in cast.declared]


# --- one -----------------------------------------------------------------------------------------


def test_without_names_there_is_one_character_whose_parameters_have_no_prefix() -> None:
    cast = load_parameters({})

    (part,) = cast.characters
    assert part.name == ""
    assert part.character.name == "humanoid"
    world = [parameter.name for parameter in WORLD_PARAMETERS]
    assert declared_names(cast) == [CHARACTERS.name, *world, *OWN]
    assert cast.values["characters"] == []


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"character": "franka_panda", "rate": 480, "gravity": 1.62},
        {"character": "lift", "initial_position": [2], "commanded_joints": ["height"]},
        {"character": "pendulum", "placement": [1.0, 2.0, 3.0, 0.0], "use_sim_time": True},
    ],
)
def test_the_one_has_the_values_that_its_parameters_alone_have(given: dict[str, object]) -> None:
    # Arrange
    whole = character(str(given.get("character", "humanoid")))
    alone = resolve(PARAMETERS + character_parameters(whole), given)

    # Act
    cast = load_parameters(given)

    # Assert
    assert cast.characters[0].values == alone
    assert cast.values == {**alone, "characters": []}


def test_an_empty_list_of_characters_is_none_at_all() -> None:
    assert load_parameters({"characters": [], "rate": 100}) == load_parameters({"rate": 100})


def test_the_defaults_of_a_character_are_declared_as_its_own() -> None:
    declared = {
        parameter.name: parameter for parameter in load_parameters({"character": "lift"}).declared
    }

    assert declared["commanded_joints"].default == ["height"]
    assert declared["initial_velocity"].default == [0.0]


@pytest.mark.parametrize("name", ["one.character", "one.initial_position", ".character", "a.b.c"])
def test_a_prefix_that_is_no_characters_is_an_unknown_parameter(name: str) -> None:
    with pytest.raises(ConfigurationError, match=f"unknown parameter '{name}'"):
        load_parameters({name: "lift"})


def test_what_is_made_of_the_parameters_is_the_simulation_of_the_one() -> None:
    # Arrange
    given: dict[str, object] = {"rate": 100, "initial_position": [2.0]}
    with (
        joint_simulation({"character": "lift", **given}) as cast,
        simulation("lift", **given) as run,
    ):
        # Act
        cast.step([np.ones(1)])
        run.advance(np.ones(1))

        # Assert
        (actor,) = cast.characters
        assert actor.setup == run.actor.setup
        assert cast.settings == run.settings
        assert actor.state.position.tobytes() == run.state.position.tobytes()


# --- several -------------------------------------------------------------------------------------


def test_each_name_is_a_character_with_parameters_of_its_own() -> None:
    # Act
    cast = load_parameters({"characters": ["one", "arm"], "arm.character": "franka_panda"})

    # Assert
    assert [part.name for part in cast.characters] == ["one", "arm"]
    assert [part.character.name for part in cast.characters] == ["humanoid", "franka_panda"]
    world = [parameter.name for parameter in WORLD_PARAMETERS]
    own = [f"{name}.{parameter}" for name in ("one", "arm") for parameter in OWN]
    assert declared_names(cast) == [CHARACTERS.name, *world, *own]
    assert cast.values["characters"] == ["one", "arm"]
    assert cast.values["arm.character"] == "franka_panda"
    assert cast.values["arm.initial_position"] == list(character("franka_panda").rest_position)
    assert "character" not in cast.values


def test_every_declared_default_passes_its_own_check() -> None:
    cast = load_parameters({"characters": ["one", "arm"], "arm.character": "franka_panda"})

    for parameter in cast.declared:
        assert parameter.checked(parameter.default) == parameter.default, parameter.name
    assert len(set(declared_names(cast))) == len(cast.declared)


def test_the_values_are_those_of_the_declared_parameters() -> None:
    cast = load_parameters({"characters": ["one", "two"], "rate": 100, "use_sim_time": True})

    assert list(cast.values) == declared_names(cast)
    assert cast.values.integer("rate") == 100


def test_what_is_given_without_a_name_is_for_all_that_have_nothing_of_their_own() -> None:
    # Act
    cast = load_parameters(
        {
            "two.character": "pendulum",
            "character": "lift",
            "characters": ["one", "two", "three"],
            "initial_velocity": [0.5],
            "three.initial_velocity": [0.25],
        }
    )

    # Assert
    assert [part.character.name for part in cast.characters] == ["lift", "pendulum", "lift"]
    velocities = [part.values.numbers("initial_velocity") for part in cast.characters]
    assert velocities == [(0.5,), (0.5,), (0.25,)]
    assert cast.values["one.initial_velocity"] == [0.5]


@pytest.mark.parametrize("own_first", [True, False])
def test_a_characters_own_value_counts_wherever_it_is_given(own_first: bool) -> None:
    items: list[tuple[str, object]] = [("one.character", "lift"), ("character", "pendulum")]
    given = dict(items if own_first else reversed(items))

    cast = load_parameters({"characters": ["one"], **given})

    assert cast.characters[0].character.name == "lift"


def test_each_part_has_all_values_as_if_it_were_alone() -> None:
    # Act
    cast = load_parameters({"characters": ["one", "arm"], "arm.character": "lift", "rate": 100})

    # Assert
    alone = resolve(PARAMETERS + character_parameters(character("lift")), {"rate": 100} | LIFT)
    assert cast.characters[1].values == alone


LIFT = {"character": "lift"}


def test_a_placement_moves_the_rest_pose_that_a_character_begins_in() -> None:
    # Act
    cast = load_parameters(
        {"characters": ["one", "two"], "two.placement": [1.0, 2.0, 0.5, np.pi / 2]}
    )

    # Assert: turned about z at the world's origin, then moved
    one, two = (part.values.numbers("initial_position") for part in cast.characters)
    assert one == character("humanoid").rest_position
    x, y, z = one[:3]
    np.testing.assert_allclose(two[:3], [1.0 - y, 2.0 + x, 0.5 + z], atol=1e-12)
    assert two[6:] == one[6:]


@pytest.mark.parametrize(
    "placement", [[], [1.0, 2.0, 3.0], [0.0] * 5, "here", [0.0, 0.0, 0.0, "x"], [np.nan] * 4]
)
def test_a_placement_that_is_not_four_numbers_is_refused(placement: object) -> None:
    for given in ({}, {"characters": ["one"]}):
        with pytest.raises(ConfigurationError, match="placement"):
            load_parameters({**given, "placement": placement})


def test_one_file_may_be_several_characters() -> None:
    cast = load_parameters({"characters": ["a", "b"], "character": FLOATING_TURNED_FRAMES})

    assert cast.characters[0].character == cast.characters[1].character


@pytest.mark.parametrize(
    "names",
    [
        [""],
        ["one", ""],
        ["1st"],
        ["_one"],
        ["one two"],
        ["one/two"],
        ["one.two"],
        ["~"],
        ["größer"],
        ["one\n"],
        ["one-two"],
    ],
)
def test_a_name_that_cannot_be_a_namespace_is_refused(names: list[str]) -> None:
    with pytest.raises(ConfigurationError, match="parameter 'characters' has") as caught:
        load_parameters({"characters": names})

    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("names", [["one", "one"], ["one", "two", "one"]])
def test_a_name_that_is_there_twice_is_refused(names: list[str]) -> None:
    with pytest.raises(ConfigurationError, match="'one'; it must list different names"):
        load_parameters({"characters": names})


@pytest.mark.parametrize("names", ["one", [1], None, [["one"]], {"one": 1}])
def test_what_is_no_list_of_names_is_refused(names: object) -> None:
    with pytest.raises(ConfigurationError, match="'characters'"):
        load_parameters({"characters": names})


def test_names_may_be_short_long_and_of_any_case() -> None:
    names = ["a", "B2", "left_One", "x" * 40]

    cast = load_parameters({"characters": names, "character": "lift"})

    assert [part.name for part in cast.characters] == names


@pytest.mark.parametrize("name", ["three.character", "three.initial_position", "On.character"])
def test_a_parameter_below_an_unknown_name_is_refused(name: str) -> None:
    with pytest.raises(ConfigurationError, match=f"unknown parameter '{name}'"):
        load_parameters({"characters": ["one", "two"], name: "lift"})


@pytest.mark.parametrize("parameter", [p.name for p in [CHARACTERS, *WORLD_PARAMETERS]])
def test_a_parameter_of_the_world_below_a_characters_name_is_refused(parameter: str) -> None:
    default = {p.name: p.default for p in [CHARACTERS, *WORLD_PARAMETERS]}[parameter]

    with pytest.raises(ConfigurationError, match=f"unknown parameter .*{parameter}'"):
        load_parameters({"characters": ["one", "two"], f"one.{parameter}": default})


@pytest.mark.parametrize("name", ["one.", "one.cuont", "one.one.character", "one"])
def test_an_unknown_parameter_of_a_character_is_refused(name: str) -> None:
    with pytest.raises(ConfigurationError, match="unknown parameter"):
        load_parameters({"characters": ["one", "two"], name: "lift"})


@pytest.mark.parametrize(
    ("parameter", "value", "why"),
    [
        ("initial_velocity", ["fast"], "'initial_velocity'"),
        ("placement", [0.0], "'placement'"),
        ("cuont", 1, "'cuont'"),
    ],
)
def test_a_wrong_value_names_the_character(parameter: str, value: object, why: str) -> None:
    with pytest.raises(ConfigurationError, match=rf"character 'two': .*{why}"):
        load_parameters({"characters": ["one", "two"], f"two.{parameter}": value})


@pytest.mark.parametrize("given", [{}, {"characters": ["one"]}])
def test_a_character_that_does_not_exist_is_refused_with_those_that_do(
    given: dict[str, object],
) -> None:
    with pytest.raises(ActuatedCharactersError, match="franka_panda, humanoid"):
        load_parameters({**given, "character": "dragon"})


def test_roles_carry_the_names_their_topics_and_messages_have() -> None:
    # Arrange
    cast = load_parameters({"characters": ["one", "arm"], "arm.character": "lift"})

    # Act
    roles = [
        make_character_setup(part.character, part.values, part.name) for part in cast.characters
    ]

    # Assert
    assert [role.prefix for role in roles] == ["one/", "arm/"]
    assert roles[1].commanded_joints == ("height",)
    assert roles[1].initial_velocity == (0.0,)
    assert (
        make_character_setup(cast.characters[0].character, cast.characters[0].values).prefix == ""
    )


# --- terrain -------------------------------------------------------------------------------------


def resting_height(box: Path, terrain: str) -> float:
    """Where a box that is 0.2 m high is after two seconds of falling from a metre."""
    with joint_simulation(
        {"character": str(box), "terrain": terrain, "initial_position": [0, 0, 1, 0, 0, 0]}
    ) as run:
        for _ in range(480):
            run.step([np.zeros(6)])
        return float(run.characters[0].state.position[2])


@pytest.fixture
def box(tmp_path: Path) -> Path:
    """The file of a box, 0.2 m high."""
    (tmp_path / "box.urdf").write_text(
        '<robot name="box"><link name="box"><inertial><mass value="1"/>'
        '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>'
        '<collision><geometry><box size="0.4 0.4 0.2"/></geometry></collision></link></robot>'
    )
    (tmp_path / "box.yaml").write_text("urdf: box.urdf\ninertia: file\n")
    return tmp_path / "box.yaml"


def test_the_plane_is_at_height_zero(box: Path) -> None:
    assert resting_height(box, "plane") == pytest.approx(0.1, abs=2e-3)


def test_without_terrain_everything_falls_for_ever(box: Path) -> None:
    step = 1.0 / 240.0

    fallen = 9.81 * step**2 * 480 * 481 / 2.0
    assert resting_height(box, "none") == pytest.approx(1.0 - fallen, abs=1e-9)


@pytest.mark.parametrize("height", [-0.6, -0.2])
def test_a_terrain_file_takes_the_place_of_the_plane(
    box: Path, tmp_path: Path, height: float
) -> None:
    (tmp_path / "ramp.urdf").write_text(SLOPE.format(height=height))

    rest = resting_height(box, str(tmp_path / "ramp.urdf"))

    assert rest == pytest.approx(height + 0.5 + 0.1, abs=5e-3)


def test_a_terrain_file_may_be_one_of_a_packages(box: Path) -> None:
    assert resting_height(box, "package://pybullet_data/plane.urdf") == pytest.approx(0.1, abs=5e-3)


def test_a_terrain_file_may_be_given_from_here(
    box: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "ramp.urdf").write_text(SLOPE.format(height=-0.5))
    monkeypatch.chdir(tmp_path)

    assert resting_height(box, "ramp.urdf") == pytest.approx(0.1, abs=5e-3)


@pytest.mark.parametrize(("friction", "slides"), [(0.0, True), (2.0, False)])
def test_the_grounds_friction_is_the_terrain_files_too(
    box: Path, tmp_path: Path, friction: float, slides: bool
) -> None:
    # Arrange
    (tmp_path / "ramp.urdf").write_text(SLOPE.format(height=-0.5))
    given = {
        "character": str(box),
        "terrain": str(tmp_path / "ramp.urdf"),
        "friction": friction,
        "initial_position": [0.0, 0.0, 0.1, 0.0, 0.0, 0.0],
        "initial_velocity": [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    }
    with joint_simulation(given) as run:
        # Act
        for _ in range(240):
            run.step([np.zeros(6)])
        speed = run.characters[0].state.velocity[0]

    # Assert
    assert speed == pytest.approx(1.0 if slides else 0.0, abs=1e-2)


def test_the_terrain_is_there_after_a_reset(box: Path, tmp_path: Path) -> None:
    (tmp_path / "ramp.urdf").write_text(SLOPE.format(height=-0.5))
    given = {"character": str(box), "terrain": str(tmp_path / "ramp.urdf")}
    (run := joint_simulation(given)).reset()
    with run:
        for _ in range(240):
            run.step([np.zeros(6)])

        assert run.characters[0].state.position[2] == pytest.approx(0.1, abs=5e-3)


def test_settings_know_which_ground_there_is(tmp_path: Path) -> None:
    (tmp_path / "ramp.urdf").write_text(SLOPE.format(height=0.0))
    grounds = {}
    for terrain in ("plane", "none", str(tmp_path / "ramp.urdf")):
        world = make_settings(
            load_parameters({"character": "lift", "terrain": terrain}).values
        ).world
        grounds[Path(terrain).stem] = (world.ground, world.terrain is not None)

    assert grounds == {"plane": (True, False), "none": (False, False), "ramp": (False, True)}


@pytest.mark.parametrize(
    ("terrain", "why"),
    [
        ("moon.urdf", "moon.urdf"),
        ("Plane", "Plane"),
        ("", "not a file"),
        ("package://no_such_package/moon.urdf", "no_such_package"),
        ("/dev/null", "not a file"),
    ],
)
def test_a_terrain_that_is_not_there_is_refused(terrain: str, why: str) -> None:
    values = load_parameters({"character": "lift", "terrain": terrain}).values

    with pytest.raises(CharacterError, match=why) as caught:
        make_settings(values)

    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "no xml",
        "<robot/>",
        '<robot><link name="a"/><link name="b"/></robot>',
        '<robot name="x"><link name="a"><collision><geometry><box size="1 x 1"/></geometry>'
        "</collision></link></robot>",
    ],
)
def test_a_terrain_file_that_is_no_sound_urdf_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "broken.urdf").write_text(text)
    values = load_parameters({"character": "lift", "terrain": str(tmp_path / "broken.urdf")}).values

    with pytest.raises(CharacterError, match=r"broken\.urdf"):
        make_settings(values)
