"""`play`: the brawl, repeated to the last bit, with all that it claims; and how a scene ends."""

import json
import os
import signal
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import Twist

from actuated_characters.bags.recording import read_recordings
from actuated_characters.replay.replay import replay
from actuated_characters.replay.through_topics import replay_states
from actuated_characters.scenes.scene import load_scene
from actuated_characters.viewer.web.server import open_socket
from msgs_config.messages import topics
from tests.support.brawl import Brawl, brawl_in_process
from tests.support.page_client import PageClient
from tests.support.ros import Processes, SimulatorClient, joint_state, wait_until, wrench_message

pytestmark = [pytest.mark.slow, pytest.mark.sharing]

SIDES = ("left", "right")
RATE = 240
DURATION = 18  # s: each falls, and gets up again
TICKS = 2 * RATE  # with the first strike, and the first fall
LONG = 120.0  # s that a run may take
FALLEN, UP = 0.3, 0.75  # m, of a root: on the ground, on two legs
FAST = ("--no-view", "--set", "sim_node.real_time_factor:=0.0")
ROUNDING = 1.0 + 1e-9


@pytest.fixture(scope="module")
def brawl() -> Brawl:
    return brawl_in_process(load_scene("brawl"), DURATION * RATE)


@pytest.fixture(scope="module")
def first_fall() -> Brawl:
    return brawl_in_process(load_scene("brawl"), TICKS)


def hash_of(directory: Path, ticks: int) -> str:
    summary = json.loads((directory / "summary.json").read_text())
    assert (summary["ticks"], summary["missing_ticks"]) == (ticks, 0)
    return str(summary["state_hash"])


@pytest.mark.nightly
def test_the_brawl_has_the_states_of_its_two_classes_and_replays(
    processes: Processes, tmp_path: Path, first_fall: Brawl
) -> None:
    """In another process, over topics, as fast as it goes: the same to the last bit."""
    run = tmp_path / "run"
    command = processes.command(
        *("play", "--scene", "brawl", "--duration", "2", "--output", str(run)), *FAST
    )

    assert command.wait(LONG) == 0, command.stderr
    assert "left goes for right: root force at most 400.0 N" in command.stdout
    assert "all is recorded" in command.stdout
    found = {name: hash_of(run / name, TICKS) for name in SIDES}
    assert found == first_fall.hashes
    assert replay(read_recordings(run)).state_hashes == found


@pytest.mark.nightly
def test_nodes_of_their_own_processes_have_the_same_states(
    processes: Processes, tmp_path: Path, first_fall: Brawl
) -> None:
    scene, run = load_scene("brawl"), tmp_path / "run"
    recorder = processes.node(topics.RECORDER_NODE, directory=str(run), characters=list(SIDES))
    own = {"real_time_factor": 0.0, "wait_for_subscribers": 3, "max_ticks": TICKS}
    nodes = {
        name: {key.replace(".", "__"): value for key, value in given.items()}
        for name, given in scene.nodes.items()
    }
    for side in SIDES:
        given = nodes[f"{side}/controller_node"] | {"wait_for_subscribers": 2}
        processes.node(topics.CONTROLLER_NODE, side, **given)
    simulator = processes.node(topics.SIM_NODE, **(nodes["sim_node"] | own))

    assert simulator.wait(LONG) == 0, simulator.stderr
    recorder.send(signal.SIGINT)
    assert recorder.wait(LONG) == 0, recorder.stderr

    found = {name: hash_of(run / name, TICKS) for name in SIDES}
    assert found == first_fall.hashes
    # the bag in the simulator's place has the opponent's states, too
    commands = replay_states(
        run, character="left", progress=lambda done: None, tell=lambda line: None
    )
    assert commands.identical
    assert commands.states == TICKS + 1


@pytest.mark.nightly
def test_they_collide_fall_and_get_up_again(brawl: Brawl) -> None:
    hits = np.flatnonzero(brawl.together > 100.0)
    assert len(hits)
    for height in brawl.heights.T:
        fallen = np.flatnonzero(height < FALLEN)
        assert len(fallen)
        assert hits[0] < fallen[0]
        assert (height[fallen[0] :] > UP).any(), "it never got up"
    for modes in brawl.modes:
        assert {"TRACK", "LIMP"} <= set(modes)
        assert any(mode.startswith("BLEND getup_") for mode in modes)
        assert {"BLEND kick", "BLEND spinkick"} <= set(modes)
    # not two heaps on the floor: most of the time at least one of them stands
    assert (brawl.heights.max(axis=1) > 0.6).mean() > 0.5


@pytest.mark.nightly
def test_what_draws_them_is_bounded_as_the_scene_says(brawl: Brawl) -> None:
    nodes = load_scene("brawl").nodes
    for row, side in enumerate(SIDES):
        given = nodes[f"{side}/controller_node"]
        force, torque = (
            np.linalg.norm(brawl.efforts[:, row, entries], axis=1)
            for entries in (slice(0, 3), slice(3, 6))
        )

        assert force.max() <= float(str(given["effort_limit.root"])) * ROUNDING
        assert torque.max() <= float(str(given["upright.torque"])) * ROUNDING
        assert force.max() > 300.0  # it is there, and less than the weight


def test_both_can_be_pushed_pelted_and_reset_and_ctrl_c_ends_it_in_good_order(
    processes: Processes, client: SimulatorClient, tmp_path: Path
) -> None:
    run = tmp_path / "run"
    environment = dict(os.environ)  # the domain of the test
    command = processes.command(
        *("play", "--scene", "brawl", "--no-view", "--output", str(run)), environment=environment
    )
    pushes = [client.speak(topics.EXTERNAL_WRENCH.under(side)) for side in SIDES]
    throws = client.speak(topics.THROW)
    thrown = client.listen(topics.THROWN)
    acting = [client.listen(topics.APPLIED_WRENCH.under(side)) for side in SIDES]
    ball = joint_state(
        0, ("mass", "x", "y", "z", "vx", "vy", "vz"), (2.0, 0.0, -2.0, 1.0, 0.0, 8.0, 1.0)
    )

    def push() -> None:
        for publisher in pushes:
            publisher.publish(wrench_message(0, [("chest", [0.0, 300.0, 0.0, 0.0, 0.0, 0.0])]))
        if not thrown.messages:
            throws.publish(ball)

    def has_acted() -> bool:
        return bool(thrown.messages) and all(
            any(message.joint_names for message in each.messages) for each in acting
        )

    client.spin_sending(push, has_acted, "pushes and a ball")
    states = client.listen(topics.JOINT_STATES.under("left"))
    assert client.reset().success
    client.spin_until(lambda: any(not each.effort for each in states.messages), "an episode")
    client.spin_until(lambda: states.messages and states.last.effort, "its second state")

    assert command.end(signal.SIGINT, LONG) == 0, command.stderr
    recordings = read_recordings(run)
    assert all(any(each.applied_wrench) for each in recordings)
    assert any(recordings[0].throws)
    result = replay(recordings)
    assert (result.difference, result.episodes) == (None, 2)


def test_play_alone_shows_the_walker_in_a_browser_until_it_is_ended(
    processes: Processes, tmp_path: Path
) -> None:
    with open_socket("127.0.0.1", 0) as free:
        port = int(free.getsockname()[1])
    command = processes.command("play", "--port", str(port))
    with PageClient(port) as page:
        wait_until(lambda: f"watch it at http://127.0.0.1:{port}" in command.stdout, "the page")
        wait_until(lambda: page.pictures > 20, "pictures")

        assert command.end(signal.SIGINT, LONG) == 0, command.stderr
    assert "the last minutes are recorded, 150 to 300 MB" in command.stdout
    (recording,) = read_recordings(tmp_path / "runs" / "play-walker")
    assert recording.character.name == "humanoid"
    assert replay([recording]).difference is None


def test_a_port_in_use_is_one_clear_line(processes: Processes) -> None:
    with open_socket("127.0.0.1", 0) as taken:
        port = taken.getsockname()[1]
        command = processes.command("play", "--port", str(port))

        assert command.wait(LONG) == 1
    error = command.stderr.splitlines()[-1]
    assert error.startswith(f"error: viewer failed: cannot listen on 127.0.0.1, port {port}: ")


@pytest.mark.nightly
def test_drive_goes_where_cmd_vel_says_and_replays(
    processes: Processes, client: SimulatorClient, tmp_path: Path
) -> None:
    ticks, run, ahead = 4 * RATE, tmp_path / "run", Twist()
    ahead.linear.x = 1.0
    velocities = client.speak(topics.CMD_VEL)
    command = processes.command(
        *("play", "--scene", "drive", "--duration", "4", "--output", str(run)), *FAST
    )

    def is_over() -> bool:
        velocities.publish(ahead)
        return command.exit_code is not None

    client.spin_until(is_over, "the end of the scene", LONG)

    assert command.exit_code == 0, command.stderr
    (recording,) = read_recordings(run)
    assert recording.reference_position[-2, 0] > 0.2  # of the last state there is none
    behind = recording.position[:-1, 0] - recording.reference_position[:-1, 0]
    assert np.abs(behind).mean() < 0.1  # it is later to speed up than the reference
    assert recording.position[-1, 2] > 0.75
    result = replay([recording])
    assert result.difference is None
    assert result.state_hashes == {"": hash_of(run, ticks)}


def test_what_a_node_refuses_is_one_clear_line(processes: Processes) -> None:
    command = processes.command(
        "play", "--scene", "brawl", *FAST, "--set", "controller_node.opponent:=''"
    )

    assert command.wait(LONG) == 1
    error = command.stderr.splitlines()[-1]
    assert error.startswith("error: composed failed: left/controller_node: ")
    assert "needs an 'opponent'" in error


@pytest.mark.nightly
def test_a_scene_that_lasts_a_tick_is_whole(processes: Processes, tmp_path: Path) -> None:
    command = processes.command("play", "--duration", "0.005", *FAST)

    assert command.wait(LONG) == 0, command.stderr
    assert "results in" in command.stdout
    hash_of(tmp_path / "runs" / "play-walker", 1)


def test_what_is_ended_before_it_has_begun_ends_in_good_order(
    processes: Processes, tmp_path: Path
) -> None:
    command = processes.command("play", "--no-view", "--set", "sim_node.real_time_factor:=1e-6")
    log = tmp_path / "runs" / "play-walker" / "logs" / "composed.log"
    wait_until(log.exists, "the last process")

    assert command.end(signal.SIGINT, LONG) == 0, command.stderr
    assert command.stdout.splitlines()[-1] == "ended before its first tick"
