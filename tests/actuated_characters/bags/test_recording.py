"""A recording read back is the run itself, to the bit; any other bag is rejected in one line."""

import hashlib
import json
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pybullet_data
import pytest
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from actuated_characters.bags.character_timeline import CharacterTimeline
from actuated_characters.bags.recording import Recording, read_recording, read_recordings
from actuated_characters.bags.world_timeline import WorldTimeline
from actuated_characters.bags.writer import BagWriter
from actuated_characters.replay.world import worlds
from actuated_characters.runs.plan import RunPlan
from msgs_config.errors import ActuatedCharactersError, MessageError, RecordingError
from msgs_config.messages import configuration, topics
from msgs_config.messages.joint_state import JointStateEncoder
from msgs_config.messages.state import StampedState
from msgs_config.messages.wrenches import WrenchArrays
from tests.support.bags import (
    CONFIGURATION,
    Made,
    RawMessage,
    add_to,
    make_run,
    raw_configuration,
    raw_references,
    raw_states,
    raw_wrenches,
    write_bag,
)

WALK = {"reference": "clip", "clip": "walk"}
PLACEMENT = [1.0, -2.0, 0.5, 0.7]
LONG = 5000  # ticks


@pytest.fixture(scope="module")
def walk() -> Made:
    return make_run("humanoid", 0.1, WALK)


@pytest.fixture(scope="module")
def pendulum() -> Made:
    return make_run("pendulum", 0.05)


def assert_same_states(recording: Recording, made: Made) -> None:
    """Stamps, positions, velocities and efforts are those of the run, to the bit."""
    assert recording.stamps_ns.tolist() == [state.stamp_ns for state in made.states]
    for row, state in enumerate(made.states):
        assert recording.position[row].tobytes() == state.position.tobytes()
        assert recording.velocity[row].tobytes() == state.velocity.tobytes()
    for row, tick in enumerate(made.ticks):
        assert tick.following.effort is not None
        assert recording.effort[row].tobytes() == tick.following.effort.tobytes()


# What a recording says


def test_a_recording_has_the_runs_own_states_efforts_and_references(
    walk: Made, tmp_path: Path
) -> None:
    recording = read_recording(write_bag(tmp_path / "bag", walk.messages()))

    assert len(walk.ticks) == 24
    assert_same_states(recording, walk)
    for row, tick in enumerate(walk.ticks):
        assert tick.reference is not None
        assert recording.reference_position[row].tobytes() == tick.reference.position.tobytes()
        assert recording.reference_velocity[row].tobytes() == tick.reference.velocity.tobytes()
    assert np.isnan(recording.reference_position[-1]).all()  # no answer to the last state
    assert recording.contacts == recording.applied_wrench == ()
    np.testing.assert_allclose(recording.times, np.arange(25) / 240.0, atol=2e-9)
    assert recording.character == walk.plan.character
    assert recording.layout.dof_names == walk.plan.character.layout.dof_names
    assert (recording.parameters["rate"], recording.parameters["terrain"]) == (240, "plane")


def test_rows_are_a_recording_of_some_states_and_the_ticks_between_them(
    walk: Made, tmp_path: Path
) -> None:
    recording = read_recording(write_bag(tmp_path / "bag", walk.messages()))

    cut = recording.rows(slice(3, 9))

    assert_same_states(cut, Made(walk.plan, walk.ticks[3:8]))
    np.testing.assert_array_equal(cut.reference_position, recording.reference_position[3:9])
    assert (cut.commands, cut.contacts, cut.throws) == (recording.commands[3:9], (), ())


def test_a_runs_directory_is_as_good_as_the_bag_in_it(pendulum: Made, tmp_path: Path) -> None:
    write_bag(tmp_path / "bag", pendulum.messages())

    assert_same_states(read_recording(tmp_path), pendulum)


def test_the_character_stands_where_it_was_placed(tmp_path: Path) -> None:
    made = make_run("kuka", 0.02, placement=PLACEMENT)

    recording = read_recording(write_bag(tmp_path / "bag", made.messages()))

    pose = recording.character.links[0].joint.pose_in_parent
    assert pose.position == tuple(PLACEMENT[:3])
    assert recording.character == made.plan.character


def test_names_may_come_in_any_order(walk: Made, tmp_path: Path) -> None:
    layout = walk.plan.character.layout
    order = np.random.default_rng(1).permutation(layout.size)
    encoder = JointStateEncoder([layout.dof_names[index] for index in order])
    shuffled = [
        (
            topics.JOINT_STATES,
            encoder.encode(
                state.stamp_ns,
                state.position[order],
                state.velocity[order],
                *(() if state.effort is None else (state.effort[order],)),
            ),
        )
        for state in walk.states
    ]

    recording = read_recording(
        write_bag(tmp_path / "bag", [raw_configuration(walk.plan), *shuffled])
    )

    assert_same_states(recording, walk)
    assert np.isnan(recording.reference_position).all()


def published_again(made: Made) -> list[RawMessage]:
    configuration, *states = without_rows(made)
    again = [states[0], *states[:3], states[1], states[2], *states[3:], states[-1]]
    return [configuration, *again]


@pytest.mark.parametrize(
    "make",
    [
        published_again,
        lambda made: [*made.messages()[1:], made.messages()[0]],  # the configuration at the end
    ],
)
def test_a_repeated_state_counts_once_and_an_early_one_counts_too(
    pendulum: Made, tmp_path: Path, make: Callable[[Made], list[RawMessage]]
) -> None:
    recording = read_recording(write_bag(tmp_path / "bag", make(pendulum)))

    assert_same_states(recording, pendulum)


def test_a_tick_that_was_a_reset_has_no_effort(pendulum: Made, tmp_path: Path) -> None:
    states = list(pendulum.states)
    states[5] = replace(states[5], effort=None)

    recording = read_recording(
        write_bag(
            tmp_path / "bag",
            [raw_configuration(pendulum.plan), *raw_states(pendulum.plan, states)],
        )
    )

    assert np.isnan(recording.effort).all(axis=1).tolist() == [
        row == 4 for row in range(len(pendulum.ticks))
    ]


def test_a_reference_counts_at_its_stamp(pendulum: Made, tmp_path: Path) -> None:
    third = pendulum.ticks[3].reference
    assert third is not None
    of_nobody = replace(third, stamp_ns=third.stamp_ns + 1)

    recording = read_recording(
        write_bag(
            tmp_path / "bag",
            [
                *raw_references(pendulum.plan, [third, of_nobody]),
                raw_configuration(pendulum.plan),
                *raw_states(pendulum.plan, pendulum.states),
            ],
        )
    )

    known = ~np.isnan(recording.reference_position[:, 0])
    assert np.flatnonzero(known).tolist() == [3]


@pytest.mark.parametrize("name", ["contacts", "applied_wrench"])
def test_wrenches_belong_to_the_tick_that_their_stamp_ends(
    pendulum: Made, tmp_path: Path, name: str
) -> None:
    topic = {"contacts": topics.CONTACTS, "applied_wrench": topics.APPLIED_WRENCH}[name]
    stamps = [state.stamp_ns for state in pendulum.states]
    touch = WrenchArrays.of_rows(stamps[3], ["rod"], [(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)], [])
    nothing = WrenchArrays.of_rows(stamps[6], [], [], [])
    messages = [*pendulum.messages(), *raw_wrenches(topic, [nothing, touch])]

    recording = read_recording(write_bag(tmp_path / "bag", messages))

    found = getattr(recording, name)
    assert len(found) == len(pendulum.ticks)
    assert [row for row, wrenches in enumerate(found) if wrenches is not None] == [2, 5]
    assert (found[2].links, found[5].links) == (("rod",), ())
    np.testing.assert_array_equal(found[2].wrenches, touch.wrenches)


def test_names_may_be_in_a_namespace(walk: Made, tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag", walk.messages(), namespace="robots/left")

    assert_same_states(read_recording(bag), walk)


def test_a_long_recording_is_read_in_a_moment(walk: Made, tmp_path: Path) -> None:
    clock = 1_000_000_000
    template = walk.states[1]
    states = [replace(template, stamp_ns=k * clock // 240) for k in range(1, LONG + 2)]
    states[0] = replace(states[0], effort=None)
    stand_ins = [
        replace(walk.ticks[0].reference, stamp_ns=state.stamp_ns)  # type: ignore[type-var]
        for state in states
    ]
    touch = [WrenchArrays.of_rows(s.stamp_ns, ["chest"], [(1.0,) * 6], []) for s in states]
    bag = write_bag(
        tmp_path / "bag",
        [
            raw_configuration(walk.plan),
            *raw_states(walk.plan, states),
            *raw_references(walk.plan, stand_ins),
            *raw_wrenches(topics.CONTACTS, touch),
        ],
    )

    started = time.process_time()
    recording = read_recording(bag)

    assert time.process_time() - started < 0.1 * LONG / 240  # ten times as fast as it went
    assert recording.effort.shape == (LONG, 34)


# What is none


def refusal(path: Path) -> str:
    """Why there is no recording to read, in one line."""
    with pytest.raises(RecordingError) as caught:
        read_recording(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_what_is_not_there_is_named(tmp_path: Path) -> None:
    assert refusal(tmp_path / "nothing") == f"no run or recording at {tmp_path / 'nothing'}"


def test_a_run_without_a_bag_has_none(tmp_path: Path) -> None:
    (tmp_path / "summary.json").touch()

    assert refusal(tmp_path).startswith(f"no recording in {tmp_path}")


def test_a_bag_that_was_not_finished_is_none(pendulum: Made, tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag", pendulum.messages())
    (bag / "metadata.yaml").unlink()

    assert "no complete recording" in refusal(tmp_path)


def without_rows(made: Made, *rows: int) -> list[RawMessage]:
    states = [state for row, state in enumerate(made.states) if row not in rows]
    return [raw_configuration(made.plan), *raw_states(made.plan, states)]


def with_another_first_state(made: Made) -> list[RawMessage]:
    other = replace(made.states[0], position=made.states[0].position + 1e-15)
    return [*without_rows(made), *raw_states(made.plan, [other])]


def with_another_configuration(made: Made) -> list[RawMessage]:
    return [*made.messages(), raw_configuration(make_run("pendulum", 0.01, gravity=1.0).plan)]


def with_a_heavier_text(made: Made) -> list[RawMessage]:
    heavier = made.plan.character.loading.urdf_text.replace("1.0", "2.0")
    return [raw_without(made.plan, urdf=heavier), *made.messages()[1:]]


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda made: made.messages()[:1], "no states"),
        (lambda made: raw_states(made.plan, made.states), "sim_node/configuration"),
        (lambda made: without_rows(made, 4, 5), "the states of ticks 5 to 6 are missing"),
        (lambda made: without_rows(made, 1, 3, 5, 7), "ticks 2, 4, 6 and 1 more times are mis"),
        (with_another_first_state, "two states of tick 1; was its simulator restarted?"),
        (with_another_configuration, "several simulators, or one restarted"),
        (with_a_heavier_text, "not the one that was recorded"),
    ],
)
def test_a_bag_that_is_no_whole_recording_is_refused(
    pendulum: Made, tmp_path: Path, make: Callable[[Made], list[RawMessage]], sentence: str
) -> None:
    assert sentence in refusal(write_bag(tmp_path / "bag", make(pendulum)))


def write_both(path: Path, left: list[RawMessage], right: list[RawMessage]) -> Path:
    """A bag of two characters, each in its namespace."""
    with BagWriter(path) as bag:
        add_to(bag, right, "right")
        add_to(bag, left, "left")
    return path


def test_of_several_characters_one_must_be_named(pendulum: Made, tmp_path: Path) -> None:
    bag = write_both(tmp_path / "bag", pendulum.messages(), pendulum.messages())

    assert "several characters (left, right)" in refusal(bag)
    with pytest.raises(
        RecordingError, match=r"'lef'; did you mean 'left'\? there are: left, right"
    ):
        read_recording(bag, "lef")


def test_each_of_several_characters_has_its_own_states(
    walk: Made, pendulum: Made, tmp_path: Path
) -> None:
    bag = write_both(tmp_path / "bag", walk.messages(), pendulum.messages())

    assert_same_states(read_recording(bag, "left"), walk)
    assert_same_states(read_recording(bag, "right"), pendulum)


def test_they_come_in_the_order_of_their_world(pendulum: Made, tmp_path: Path) -> None:
    names = ("right", "left")
    left, right = (
        [raw_configuration(pendulum.plan, name, names), *pendulum.messages()[1:]]
        for name in ("left", "right")
    )

    recordings = read_recordings(write_both(tmp_path / "bag", left, right))

    assert [recording.name for recording in recordings] == ["right", "left"]
    assert {recording.world.namespace for recording in recordings} == {""}


def test_what_comes_before_an_episode_is_left_out(pendulum: Made, tmp_path: Path) -> None:
    states = list(pendulum.states)
    states[4] = replace(states[4], effort=None)
    messages = [
        raw_configuration(pendulum.plan),
        *raw_states(pendulum.plan, states[2:]),
        *raw_references(pendulum.plan, [tick.reference for tick in pendulum.ticks]),  # type: ignore[misc]
    ]

    recording = read_recording(write_bag(tmp_path / "bag", messages))

    assert recording.stamps_ns.tolist() == [state.stamp_ns for state in states[4:]]
    assert recording.skipped_states == 2
    assert recording.episode_rows.tolist() == [0]
    reference = pendulum.ticks[4].reference
    assert reference is not None
    assert recording.reference_position[0].tobytes() == reference.position.tobytes()


def test_a_bag_in_which_no_episode_begins_is_read_and_cannot_be_repeated(
    pendulum: Made, tmp_path: Path
) -> None:
    recording = read_recording(write_bag(tmp_path / "bag", without_rows(pendulum, 0)))

    assert recording.begins_amid
    assert recording.skipped_states == 0
    assert recording.stamps_ns.tolist() == [state.stamp_ns for state in pendulum.states[1:]]
    assert recording.position[0].tobytes() == pendulum.states[1].position.tobytes()
    with pytest.raises(RecordingError, match="in the middle of an episode"):
        worlds((recording,))


def test_commands_are_there_as_they_were_sent(pendulum: Made, tmp_path: Path) -> None:
    encoder, stamps = JointStateEncoder(["hinge"]), [s.stamp_ns for s in pendulum.states]
    sent = [(stamps[3], 1.5), (stamps[3], 2.5), (0, 3.5), (stamps[0], 4.5)]
    messages = [
        (topics.JOINT_TORQUES, encoder.encode(stamp, effort=np.array([effort])))
        for stamp, effort in sent
    ]
    no_command = (topics.JOINT_TORQUES, b"\0\1\0\0 nonsense")

    recording = read_recording(
        write_bag(tmp_path / "bag", [*pendulum.messages(), *messages, no_command])
    )

    found = {row: c for row, c in enumerate(recording.commands) if c}
    assert {row: [c.efforts.tolist() for c in each] for row, each in found.items()} == {
        0: [[4.5]],
        3: [[1.5], [2.5]],
    }
    assert found[0][0].names == ("hinge",)
    assert [c.efforts.tolist() for c in recording.unstamped_commands] == [[3.5]]


def test_what_a_controller_says_of_itself_is_there_once(pendulum: Made, tmp_path: Path) -> None:
    plan, topic = pendulum.plan, topics.CONFIGURATION.of(topics.CONTROLLER_NODE)
    texts = [
        configuration.describe(plan.character, plan.controller, since_ns=since)
        for since in (None, None, pendulum.states[3].stamp_ns)
    ]
    messages = [(topic, serialize_message(String(data=text))) for text in (*texts, "no JSON")]

    recording = read_recording(write_bag(tmp_path / "bag", [*pendulum.messages(), *messages]))

    assert [c.after_stamp_ns for c in recording.controller] == [None, pendulum.states[3].stamp_ns]
    assert recording.controller[0].parameters["rate"] == 240


def own_character(folder: Path) -> Path:
    """A pendulum of the user's own; its file."""
    text = Path("msgs_config/character/data/pendulum.urdf").read_text()
    (folder / "thing.urdf").write_text(text)
    file = folder / "thing.yaml"
    file.write_text(
        "urdf: thing.urdf\nfixed_base: true\njoints: {hinge: {lower: -1.0, upper: 1.0}}\n"
    )
    return file


def raw_without(plan: RunPlan, *names: str, **changes: object) -> RawMessage:
    """The simulator's configuration without some entries, and with others changed."""
    text = configuration.describe(plan.character, plan.simulator)
    content = {key: value for key, value in json.loads(text).items() if key not in names}
    return CONFIGURATION, serialize_message(String(data=json.dumps(content | changes)))


@pytest.mark.parametrize("alone", [False, True], ids=["file", "urdf alone"])
def test_a_character_is_made_from_the_texts_in_the_bag(tmp_path: Path, alone: bool) -> None:
    file = own_character(tmp_path)
    made = make_run(str(file.with_suffix(".urdf") if alone else file), 0.02)
    bag = write_bag(tmp_path / "bag", made.messages())

    for each in (file, file.with_suffix(".urdf")):
        each.unlink()

    recording = read_recording(bag)
    assert_same_states(recording, made)
    assert recording.character == made.plan.character


NEW = ("character_path", "urdf_path", "meshes", "name", "characters")  # in a configuration


def test_a_mesh_that_is_another_one_or_missing_is_named(tmp_path: Path) -> None:
    made = make_run("franka_panda", 0.01)
    text = configuration.describe(made.plan.character, made.plan.simulator)
    hashes = json.loads(text)["meshes"]
    name = "package://meshes/collision/hand.obj"
    path = Path(pybullet_data.getDataPath()) / "franka_panda/meshes/collision/hand.obj"
    assert hashes[name] == hashlib.sha256(path.read_bytes()).hexdigest()

    other = raw_without(made.plan, meshes=hashes | {name: "0" * 64})
    line = refusal(write_bag(tmp_path / "other", [other, *made.messages()[1:]]))
    assert "is not the one that it was" in line and path.name in line
    urdf = made.plan.character.loading.urdf_text.replace(name, f"{name}.gone.obj")
    gone = raw_without(made.plan, urdf=urdf)
    line = refusal(write_bag(tmp_path / "gone", [gone, *made.messages()[1:]]))
    assert f"{path.name}.gone.obj" in line


@pytest.mark.parametrize("reason", ["no JSON", "{}", '{"character": 1, "joints": []}'])
def test_a_configuration_of_somebody_else_is_refused(
    pendulum: Made, tmp_path: Path, reason: str
) -> None:
    messages = [
        (CONFIGURATION, serialize_message(String(data=reason))),
        *raw_states(pendulum.plan, pendulum.states),
    ]

    with pytest.raises(MessageError, match=r"recording .*bag: .*configuration"):
        read_recording(write_bag(tmp_path / "bag", messages))


def test_states_of_something_else_are_refused(pendulum: Made, tmp_path: Path) -> None:
    state = StampedState(pendulum.states[0].stamp_ns, np.zeros(1), np.zeros(1), None)
    raw = JointStateEncoder(["elbow"]).encode(state.stamp_ns, state.position, state.velocity)
    messages = [raw_configuration(pendulum.plan), (topics.JOINT_STATES, raw)]

    with pytest.raises(ActuatedCharactersError, match="elbow"):
        read_recording(write_bag(tmp_path / "bag", messages))


@pytest.mark.parametrize("kind", [WorldTimeline, CharacterTimeline])
def test_what_is_read_of_a_world_or_a_character_is_on_a_topic_of_one(
    kind: type[WorldTimeline] | type[CharacterTimeline],
) -> None:
    named = {each.name: topic for topic in topics.TABLE for each in topic.as_others_name_it}

    assert {named[name].of_world for name in kind.TOPICS} == {kind is WorldTimeline}
