"""Which motion the parameters make, with which numbers, and what they are refused for."""

from pathlib import Path

import numpy as np
import pytest

from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import RunPlan, make_plan
from controller_node.references import keyframes as module
from controller_node.references.base import Motion, Reference, ReferenceState
from controller_node.references.clip import ClipReference
from controller_node.references.factory import MOTION_PARAMETERS, make_motion
from controller_node.references.files.keyframes import read_keyframes
from controller_node.references.hold import HoldReference
from controller_node.references.keyframes import KEYFRAMES_DIRECTORY, KeyframesReference
from controller_node.references.signals import SineReference, StepReference
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.clips.reading import read_clip
from msgs_config.errors import ActuatedCharactersError
from msgs_config.parameters import resolve
from tests.support.physics import FLOATING_TURNED_FRAMES, character

PANDA, HUMANOID = character("franka_panda"), character("humanoid")
LIFT, PENDULUM = character("lift"), character("pendulum")
TURNED = character(FLOATING_TURNED_FRAMES)
ARM = ["panda_joint1", "panda_joint4"]
MOVES = """
keyframes:
  - {time: 0.0, pose: {panda_joint1: 0.25}}
  - {time: 1.0, pose: {panda_joint1: -0.5}}
"""


def moves(directory: Path, suffix: str = ".yaml") -> str:
    """The path of a file of keyframes for the arm."""
    file = directory / f"moves{suffix}"
    file.write_text(MOVES, encoding="utf-8")
    return str(file)


def motion_of(whole: Character, **given: object) -> Motion:
    """The motion of the parameters given; a name's dots are written as double underscores."""
    named = {name.replace("__", "."): value for name, value in given.items()}
    return make_motion(whole, resolve(MOTION_PARAMETERS, named))


def error_of(whole: Character, **given: object) -> str:
    """The one line that the parameters given are refused with."""
    with pytest.raises(ActuatedCharactersError) as caught:
        motion_of(whole, **given)
    line = str(caught.value)
    assert "\n" not in line
    return line


def moved(whole: Character, state: ReferenceState) -> FloatArray:
    """How far a state lies from the rest pose (n,)."""
    layout = whole.layout
    rest = layout.configuration(np.array(whole.rest_position))
    return layout.difference(rest, state.configuration)


def of(whole: Character, **values: float) -> list[float]:
    """Values of some degrees of freedom, zero elsewhere."""
    assert set(values) <= set(whole.layout.dof_names)
    return [values.get(name, 0.0) for name in whole.layout.dof_names]


def assert_same(one: Reference, other: Reference) -> None:
    """Two references are the same motion, to the bit."""
    for time in (0.0, 0.3, 0.77, 2.5):
        states = one.sample(time), other.sample(time)
        assert len({state.configuration.position.tobytes() for state in states}) == 1
        assert len({state.velocity.tobytes() for state in states}) == 1
        assert len({state.acceleration.tobytes() for state in states}) == 1


# What each choice makes


def test_the_rest_pose_is_what_is_tracked_if_nothing_is_said() -> None:
    made = motion_of(HUMANOID)

    assert type(made.reference) is HoldReference
    assert made.warnings == ()
    state = made.reference.sample(3.0)
    assert state.configuration.position.tolist() == list(HUMANOID.rest_position)
    assert not state.velocity.any()


@pytest.mark.parametrize(("named", "clip"), [({}, "walk"), ({"clip": "run"}, "run")])
def test_a_clip_is_read_by_its_name_and_is_the_walk_if_none_is_named(
    named: dict[str, object], clip: str
) -> None:
    made = motion_of(HUMANOID, reference="clip", **named)

    assert type(made.reference) is ClipReference
    assert_same(made.reference, ClipReference(HUMANOID.layout, read_clip(HUMANOID, clip)))


def test_a_clip_that_is_kept_within_limits_is_noted() -> None:
    frames = read_clip(HUMANOID, "spinkick")
    assert frames.clamped

    (warning,) = motion_of(HUMANOID, reference="clip", clip="spinkick").warnings

    assert all(name in warning for name in frames.clamped)


@pytest.mark.parametrize("suffix", [".yaml", ".yml"])
def test_keyframes_are_read_from_a_path(tmp_path: Path, suffix: str) -> None:
    made = motion_of(PANDA, reference="keyframes", keyframes=moves(tmp_path, suffix))

    assert type(made.reference) is KeyframesReference
    index = PANDA.layout.dof_names.index("panda_joint1")
    at = [made.reference.sample(time).configuration.position[index] for time in (0.0, 1.0)]
    assert at == pytest.approx([0.25, -0.5], abs=1e-12)


def test_keyframes_that_ship_are_read_by_their_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = moves(tmp_path)
    monkeypatch.setattr(module, "KEYFRAMES_DIRECTORY", tmp_path)

    by_name = motion_of(PANDA, reference="keyframes", keyframes="moves").reference

    assert_same(by_name, motion_of(PANDA, reference="keyframes", keyframes=path).reference)


@pytest.mark.parametrize("name", sorted(path.stem for path in KEYFRAMES_DIRECTORY.glob("*.yaml")))
def test_all_keyframes_that_ship_are_named_for_a_character_that_can_follow_them(name: str) -> None:
    whole = character(name.split("_")[0])

    made = motion_of(whole, reference="keyframes", keyframes=name)

    file = KEYFRAMES_DIRECTORY / f"{name}.yaml"
    assert_same(made.reference, KeyframesReference(whole.layout, read_keyframes(whole, str(file))))
    assert made.warnings == ()


def test_what_the_author_of_keyframes_may_have_overlooked_is_noted(tmp_path: Path) -> None:
    file = tmp_path / "wide.yaml"
    poses = "".join(
        f"  - {{time: {time}, pose: {{panda_joint1: {angle}}}}}\n"
        for time, angle in ((0.0, 0.0), (1.0, 2.95), (2.0, 2.95), (3.0, 0.0))
    )
    file.write_text(f"keyframes:\n{poses}", encoding="utf-8")

    made = motion_of(PANDA, reference="keyframes", keyframes=str(file))

    assert "panda_joint1" in made.warnings[0]


def test_a_step_has_the_size_the_time_and_the_degrees_of_freedom_given() -> None:
    made = motion_of(PANDA, reference="step", signal__dofs=ARM, step__size=-0.2, step__time=1.25)

    assert type(made.reference) is StepReference
    before, after = (made.reference.sample(time) for time in (1.2499, 1.25))
    np.testing.assert_allclose(moved(PANDA, before), 0.0, atol=1e-15)
    expected = of(PANDA, panda_joint1=-0.2, panda_joint4=-0.2)
    np.testing.assert_allclose(moved(PANDA, after), expected, atol=1e-15)
    assert made.warnings == ()


def test_a_sine_has_the_amplitude_the_frequency_and_the_degrees_of_freedom_given() -> None:
    made = motion_of(
        PANDA, reference="sine", signal__dofs=ARM, sine__amplitude=0.15, sine__frequency=2.0
    )

    assert type(made.reference) is SineReference
    crest, start = made.reference.sample(0.125), made.reference.sample(0.0)
    expected = of(PANDA, panda_joint1=0.15, panda_joint4=0.15)
    np.testing.assert_allclose(moved(PANDA, crest), expected, atol=1e-12)
    np.testing.assert_allclose(start.velocity, 4.0 * np.pi * np.array(expected), atol=1e-12)


@pytest.mark.parametrize("signal", ["step", "sine"])
def test_a_signal_moves_every_degree_of_freedom_with_a_motor_if_none_is_named(signal: str) -> None:
    for whole in (LIFT, PENDULUM, TURNED):
        made = motion_of(whole, reference=signal, step__time=0.0, sine__frequency=1.0)

        apart = moved(whole, made.reference.sample(0.25))
        root = 6 * whole.layout.has_floating_base
        np.testing.assert_allclose(apart[:root], 0.0, atol=1e-15)
        np.testing.assert_allclose(apart[root:], 0.1, atol=1e-12)


def test_a_signal_may_move_the_root_if_that_is_named() -> None:
    made = motion_of(HUMANOID, reference="step", signal__dofs=["root_z"], step__time=0.0)

    expected = of(HUMANOID, root_z=0.1)
    np.testing.assert_allclose(moved(HUMANOID, made.reference.sample(0.0)), expected, atol=1e-15)


# What is refused

REFUSED: dict[str, tuple[Character, dict[str, object], list[str]]] = {
    "keyframes that do not ship": (
        HUMANOID,
        {"reference": "keyframes", "keyframes": "humanoid_stan"},
        ["unknown keyframes 'humanoid_stan'", "did you mean 'humanoid_stand'?", ".yaml"],
    ),
    "keyframes without a name": (
        HUMANOID,
        {"reference": "keyframes"},
        ["unknown keyframes ''", "humanoid_stand", ".yaml"],
    ),
    "a name as a way to other files": (
        HUMANOID,
        {"reference": "keyframes", "keyframes": "../characters/lift"},
        ["unknown keyframes '../characters/lift'"],
    ),
    "no such file": (
        PANDA,
        {"reference": "keyframes", "keyframes": "/nowhere/keys.yaml"},
        ["/nowhere/keys.yaml"],
    ),
    "no such clip": (
        HUMANOID,
        {"reference": "clip", "clip": "wlak"},
        ["'wlak'", "did you mean 'walk'?"],
    ),
    "an unknown degree of freedom": (
        PANDA,
        {"reference": "sine", "signal__dofs": ["panda_joint1", "panda_jiont2"]},
        ["'panda_jiont2'", "did you mean 'panda_joint2'?"],
    ),
    "straight knees, which would bend the wrong way": (
        HUMANOID,
        {"reference": "step", "signal__dofs": ["right_knee"]},
        ["knee", "beyond its limits", "its size must be from"],
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_tracked_is_refused_with_what_would_be_right(case: str) -> None:
    whole, given, words = REFUSED[case]

    line = error_of(whole, **given)

    assert all(word in line for word in words), line


def test_keyframes_of_another_character_are_refused(tmp_path: Path) -> None:
    line = error_of(PENDULUM, reference="keyframes", keyframes=moves(tmp_path))

    assert "'panda_joint1'" in line and "hinge" in line


@pytest.mark.parametrize("signal", ["step", "sine"])
def test_a_signal_on_all_joints_leaves_those_that_it_would_break_and_says_so(signal: str) -> None:
    motion = motion_of(HUMANOID, reference=signal)

    (warning,) = motion.warnings
    assert "right_knee" in warning and "right_hip" not in warning
    names = HUMANOID.layout.dof_names
    moved = motion.reference.sample(1.3).configuration.position - HUMANOID.rest_position
    assert moved[names.index("right_knee")] == 0.0
    assert moved[names.index("neck_x")] != 0.0


WRONG_VALUES = {
    "reference": "jump",
    "step__size": float("nan"),
    "step__time": -1.0,
    "sine__frequency": -0.5,
    "sine__amplitude": "much",
    "signal__dofs": "hinge",
    "keyframes": 3,
}


@pytest.mark.parametrize("name", WRONG_VALUES)
def test_a_value_that_makes_no_sense_is_refused_by_the_parameters_name(name: str) -> None:
    line = error_of(PENDULUM, **{name: WRONG_VALUES[name]})

    assert f"'{name.replace('__', '.')}'" in line


# Where a run begins

REST = np.array(PANDA.rest_position)
STILL = np.zeros(PANDA.layout.size)
KEYFRAME = np.where(np.array(PANDA.layout.dof_names) == "panda_joint1", 0.25, REST)
STEP = {"reference": "step", "signal.dofs": ["panda_joint4"], "step.size": -0.2}
SINE = {"reference": "sine", "signal.dofs": ["panda_joint1"], "sine.amplitude": 0.3}
AWAY = REST + of(PANDA, panda_joint4=-0.2)
SWING = np.array(of(PANDA, panda_joint1=0.3 * 2.0 * np.pi * 0.5))
FIRST_STATES: dict[str, tuple[dict[str, object], FloatArray, FloatArray]] = {
    "hold": ({}, REST, STILL),
    "keyframes": ({"reference": "keyframes"}, KEYFRAME, STILL),
    "a step to come": (STEP, REST, STILL),
    "a step at once": ({**STEP, "step.time": 0.0}, AWAY, STILL),
    "sine": ({**SINE, "sine.frequency": 0.5}, REST, SWING),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", FIRST_STATES)
def test_a_run_begins_in_the_references_first_state(tmp_path: Path, kind: str) -> None:
    given, position, velocity = FIRST_STATES[kind]
    file = {"keyframes": moves(tmp_path)} if kind == "keyframes" else {}

    assert_begins(make_plan("franka_panda", 0.1, {**given, **file}, {}, {}), position, velocity)


def test_a_run_of_a_clip_begins_in_its_first_frame_and_moves() -> None:
    first = ClipReference(HUMANOID.layout, read_clip(HUMANOID, "walk")).sample(0.0)

    assert np.abs(first.velocity).max() > 0.1
    plan = make_plan("humanoid", 0.1, {"reference": "clip"}, {}, {})
    assert_begins(plan, first.configuration.position, first.velocity)


def assert_begins(plan: RunPlan, position: FloatArray, velocity: FloatArray) -> None:
    """The plan says so, and so do the engine's first state and the reference beside it."""
    layout = plan.character.layout
    initial = plan.simulator["initial_position"], plan.simulator["initial_velocity"]
    np.testing.assert_allclose(initial[0], position, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(initial[1], velocity, rtol=0.0, atol=1e-12)
    tick = next(iter(ticks_in_process(plan)))
    begun, wanted = layout.configuration(tick.state.position), layout.configuration(position)
    np.testing.assert_allclose(layout.difference(wanted, begun), 0.0, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(tick.state.velocity, velocity, rtol=0.0, atol=1e-9)
    assert tick.reference is not None
    np.testing.assert_allclose(tick.reference.position, position, rtol=0.0, atol=1e-12)


def test_a_run_says_what_its_user_should_know_of_its_motion() -> None:
    plan = make_plan("humanoid", 0.1, {"reference": "clip", "clip": "spinkick"}, {}, {})

    warnings = motion_of(HUMANOID, reference="clip", clip="spinkick").warnings
    assert warnings and set(warnings) <= set(plan.warnings)
