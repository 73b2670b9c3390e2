"""The command line, as a user calls it: what a run leaves behind, and how it ends when it must."""

import math
import os
import re
import shlex
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
import rclpy
from rclpy.context import Context

from actuated_characters.bags.reader import read_messages
from actuated_characters.bags.recording import read_recording
from actuated_characters.cli import main
from actuated_characters.metrics.state_hash import StateHash
from actuated_characters.runs.plan import make_plan
from actuated_characters.runs.processes import MODULES
from msgs_config.character.loading import load_character
from msgs_config.messages import topics
from msgs_config.messages.joint_state import JointStateDecoder, state_in_layout
from tests.support.physics import controller, run_together, simulation
from tests.support.ros import Client, Processes, stamp_ns, tick_of, wait_until
from tests.support.runs import Run, parameters_of, summary_of

pytestmark = [pytest.mark.slow, pytest.mark.sharing]

TICKS = 480
WALK = ("run", "--character", "humanoid", "--clip", "walk", "--duration", "2")
LONG_WALK = ("run", "--clip", "walk", "--duration", "1e6")
SHORT = ("run", "--character", "pendulum", "--duration", "0.1", "--in-process")
ENDLESS = ("run", "--character", "pendulum", "--duration", "1e6")
FIGURES = {
    "ticks",
    "sim_time_s",
    "wall_time_s",
    "real_time_factor",
    "fell",
    "joint_error_mean_rad",
    "root_error_mean_m",
    "root_error_max_m",
    "actuators",
    "degrees_of_freedom",
    "assist_force_mean_n",
    "body_weight_n",
    "saturated_fraction",
    "rejected_commands",
    "duplicate_commands",
    "state_hash",
    "lost_messages",
}
SECONDS = 10.0  # that a run may take to end when it must


@pytest.fixture(scope="module")
def together(domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Processes]:
    """Starts processes for several tests."""
    del domain
    started = Processes(tmp_path_factory.mktemp("runs"))
    yield started
    started.end()


@pytest.fixture(scope="module")
def walk(together: Processes, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of the main job, 2 s of it."""
    directory = tmp_path_factory.mktemp("walk") / "made" / "on the way"
    Run(together, *WALK, "--output", str(directory)).finish()
    return directory


@pytest.fixture(scope="module")
def unassisted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same without root assistance and without a bag."""
    directory = tmp_path_factory.mktemp("unassisted")
    switch = ("--set", "controller_node.root_assistance:=false")
    assert main([*WALK, *switch, "--in-process", "--no-record", "--output", str(directory)]) == 0
    return directory


# What a run leaves behind


def test_the_summary_has_every_figure_and_they_are_sane(walk: Path) -> None:
    metrics = summary_of(walk)

    assert set(metrics) >= FIGURES
    assert metrics["ticks"] == TICKS
    assert metrics["sim_time_s"] == pytest.approx(2.0, abs=1e-8)
    assert metrics["real_time_factor"] == pytest.approx(2.0 / metrics["wall_time_s"])
    assert metrics["fell"] is False
    assert 0.0 < metrics["joint_error_mean_rad"] <= 0.08
    assert 0.0 < metrics["root_error_mean_m"] <= 0.055
    assert metrics["root_error_mean_m"] < metrics["root_error_max_m"] < 0.2
    assert metrics["body_weight_n"] == pytest.approx(45.0 * 9.81, rel=0.001)
    assert 0.0 < metrics["assist_force_mean_n"] <= 0.56 * metrics["body_weight_n"]
    assert 0.0 <= metrics["saturated_fraction"] < 0.05
    assert metrics["rejected_commands"] == metrics["duplicate_commands"] == 0
    assert len(bytes.fromhex(metrics["state_hash"])) == 32
    assert all(math.isfinite(value) for value in metrics.values() if isinstance(value, float))
    assert parameters_of(walk, "sim_node")["lockstep_timeout"] > 0.0


def test_the_directory_holds_bag_plot_series_parameters_and_logs(walk: Path) -> None:
    found = {path.relative_to(walk).as_posix() for path in walk.rglob("*") if path.is_file()}

    nodes = ("sim_node", "controller_node", "recorder")
    logs_of_ros = {name for name in found if re.fullmatch(r"logs/python.*_\d+\.log", name)}
    assert found - logs_of_ros == {
        "summary.json",
        "measurements.csv",
        "plot.png",
        "bag/metadata.yaml",
        "bag/bag.mcap",
        *(f"parameters/{node}.yaml" for node in nodes),
        *(f"logs/{node}.log" for node in nodes),
    }
    assert (walk / "plot.png").read_bytes().startswith(b"\x89PNG")
    assert len((walk / "measurements.csv").read_text().splitlines()) == 1 + TICKS


def test_in_one_process_without_ros_the_states_are_the_same_to_the_bit(
    walk: Path, together: Processes, tmp_path: Path
) -> None:
    run = Run(together, *WALK, "--in-process", "--output", str(tmp_path / "run")).finish()

    over_topics, in_process = summary_of(walk), summary_of(tmp_path / "run")
    assert "ROS_DOMAIN_ID" not in run.process.stdout
    assert set(in_process) == set(over_topics)
    for figure in set(in_process) - {"wall_time_s", "real_time_factor"}:
        assert in_process[figure] == over_topics[figure]


@pytest.mark.nightly
def test_with_every_core_kept_busy_the_states_are_the_same_to_the_bit(
    walk: Path, processes: Processes, tmp_path: Path
) -> None:
    for _ in range(os.cpu_count() or 1):
        processes.python("-c", "while True: pass")

    Run(processes, *WALK, "--no-record", "--output", str(tmp_path / "run")).finish()

    assert summary_of(tmp_path / "run")["state_hash"] == summary_of(walk)["state_hash"]


def test_the_parameters_left_behind_start_the_nodes_alone_into_the_same_states(
    walk: Path, processes: Processes
) -> None:
    layout, decoder = load_character("humanoid").layout, JointStateDecoder()
    recorded = {
        state.stamp_ns: state
        for message in read_messages(walk / "bag", ["/joint_states"])
        for state in [state_in_layout(layout, decoder.decode(message.raw))]
    }
    context = Context()
    rclpy.init(context=context)
    client = Client(context)
    try:
        client.listen(topics.JOINT_TORQUES)
        states = client.listen(topics.JOINT_STATES)

        for node in ("controller_node", "sim_node"):
            file = str(walk / "parameters" / f"{node}.yaml")
            both = ("-p", "wait_for_subscribers:=2")  # each other, and the test's node
            processes.python("-m", f"{node}.main", "--ros-args", "--params-file", file, *both)

        client.spin_until(lambda: states.messages and tick_of(states.last) > 100, "states")
        for message in states.messages:
            expected = recorded[stamp_ns(message)]
            assert list(message.position) == expected.position.tolist()
            assert list(message.velocity) == expected.velocity.tolist()
    finally:
        client.close()
        context.try_shutdown()


@pytest.mark.nightly
def test_composed_the_run_has_the_same_figures_and_leaves_the_same_files(
    walk: Path, together: Processes, tmp_path: Path
) -> None:
    Run(together, *WALK, "--composed", "--output", str(tmp_path / "run")).finish()

    apart, composed = summary_of(walk), summary_of(tmp_path / "run")
    for figure in set(apart) - {"wall_time_s", "real_time_factor"}:
        assert composed[figure] == apart[figure]
    files = {path.relative_to(tmp_path / "run").as_posix() for path in tmp_path.rglob("*.*")}
    assert "logs/composed.log" in files and "logs/sim_node.log" not in files
    for node in ("sim_node", "controller_node"):
        assert parameters_of(tmp_path / "run", node) == parameters_of(walk, node)


def test_without_assistance_the_walk_falls_and_without_a_bag_all_figures_are_there(
    unassisted: Path, walk: Path
) -> None:
    metrics = summary_of(unassisted)

    assert metrics["ticks"] == TICKS
    assert metrics["fell"] is True
    assert metrics["assist_force_mean_n"] == 0.0
    assert "root" not in parameters_of(unassisted, "sim_node")["commanded_joints"]
    assert parameters_of(unassisted, "controller_node")["root_assistance"] is False
    assert not (unassisted / "bag").exists()
    assert set(summary_of(unassisted)) == set(summary_of(walk))
    assert (unassisted / "plot.png").exists()


def test_root_that_is_not_commanded_switches_assistance_off() -> None:
    joints = load_character("humanoid").layout.actuated_joint_names

    plan = make_plan("humanoid", 2.0, {"reference": "hold"}, {"commanded_joints": joints}, {})

    assert plan.controller["root_assistance"] is False


@pytest.mark.nightly
def test_two_runs_at_once_take_different_domains_and_do_not_hear_each_other(
    processes: Processes, tmp_path: Path
) -> None:
    runs = {
        stiffness: Run(
            processes,
            *("run", "--character", "pendulum", "--duration", "0.5", "--no-record"),
            *("--set", f"controller_node.gains.hinge.p:={stiffness}"),
            *("--output", str(tmp_path / str(stiffness))),
        )
        for stiffness in (20.0, 80.0)
    }

    domains = [
        line
        for run in runs.values()
        for line in run.finish().process.stdout.splitlines()
        if line.startswith("ROS_DOMAIN_ID=")
    ]

    assert len(set(domains)) == 2
    for stiffness in runs:
        found = summary_of(tmp_path / str(stiffness))["state_hash"]
        assert found == hash_of_a_pendulum(stiffness, ticks=120)


def hash_of_a_pendulum(stiffness: float, ticks: int) -> str:
    """The hash of the states that a pendulum of its own goes through, from rest."""
    state_hash = StateHash()
    driver = controller("pendulum", **{"gains.hinge.p": stiffness})
    with simulation("pendulum") as alone:
        for state, _, _ in run_together(alone, driver, ticks):
            state_hash.add(state)
        state_hash.add(alone.state)
    return state_hash.hexdigest()


# The directory


def test_results_are_not_overwritten_unasked_and_other_files_never_deleted(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, own_handlers: None
) -> None:
    arguments = [*SHORT, "--output", str(tmp_path / "run")]
    assert main(arguments) == 0
    before = summary_of(tmp_path / "run")

    assert main(arguments) == 1
    assert "error: " in (errors := capsys.readouterr().err) and "--overwrite" in errors
    (tmp_path / "run" / "thesis.tex").write_text("years of work")
    assert main([*arguments, "--overwrite"]) == 1

    assert str(tmp_path / "run") in capsys.readouterr().err
    assert summary_of(tmp_path / "run") == before
    assert (tmp_path / "run" / "thesis.tex").read_text() == "years of work"


def test_overwriting_replaces_the_results_and_ends_with_the_path_of_the_picture(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, own_handlers: None
) -> None:
    directory = tmp_path / "run"
    (directory / "bag").mkdir(parents=True)
    (directory / "bag" / "bag.mcap").write_text("old")
    (directory / "summary.json").write_text('{"ticks": "old"}')

    code = main([*SHORT, "--overwrite", "--output", str(directory)])

    assert code == 0
    assert summary_of(directory)["ticks"] == 24
    assert len(read_recording(directory).effort) == 24
    assert capsys.readouterr().out.splitlines()[-1].endswith(f": {directory / 'plot.png'}")


# Errors


PENDULUM = "run --character pendulum --duration 1e6"
IN_PROCESS = "run --character pendulum --duration 0.1 --in-process"
SET = f"{PENDULUM} --set"
ALL_JOINTS = ",".join(load_character("humanoid").layout.joint_names)
WRONG: list[tuple[str, ...]] = [  # a command, and what its error names
    ("run --character centaur", "'centaur'", "humanoid", "pendulum"),
    ("run --clip swim", "'swim'", "walk", "backflip"),
    (f"{PENDULUM} --clip walk", "pendulum"),
    (f"{SET} simulator.rate:=480", "'simulator'", "sim_node, controller_node"),
    (f"{SET} sim_node.frition:=1.0", "'frition'", "friction"),
    (f"{SET} sim_node.friction:=rough", "'friction'", "'rough'", "number"),
    (f"{SET} controller_node.gains.hinge.p:=-5.0", "'gains.hinge.p'", "-5.0"),
    (f"{SET} controller_node.gains.tail.p:=5.0", "tail", "gains.hinge.p"),
    (f"{SET} sim_node.commanded_joints:=[tail]", "'tail'", "hinge"),
    (
        "run --set controller_node.root_assistance:=false "
        f"--set sim_node.commanded_joints:=[{ALL_JOINTS}]",
        "commanded_joints",
        "root",
    ),
    (
        "run --character franka_panda --set sim_node.commanded_joints:=[panda_joint1]",
        "commanded_joints",
        "panda_joint2",
    ),
    ("run --character pendulum --duration 0", "duration", "0.0 s"),
    ("run --character pendulum --duration nan", "nan"),
    (f"{SET} sim_node.max_ticks:=0", "'max_ticks'", "--duration"),
    (
        f"{SET} sim_node.initial_state:=reference",
        *("'initial_state'", "the run itself", "initial_position"),
    ),
    (f"{SET} sim_node.rate:=240 --set controller_node.rate:=480", "'rate'", "240", "480"),
    (f"{IN_PROCESS} --topic /mine", "--topic", "--in-process"),
    (f"{PENDULUM} --compression zstd --no-record", "--compression", "--no-record"),
    (f"{PENDULUM} --exclude contcts", "'contcts'", "mean 'contacts'"),
    (f"{PENDULUM} --exclude joint_states", "'joint_states'"),
    (f"{PENDULUM} --sensor all", "--sensor", "'pendulum' has no sensors"),
    ("run --sensor imu/pelvis", "--sensor", "'imu/pelvis'", "mean 'imu/pelvis_imu'"),
    (f"{SET} sim_node.rate=240", "sim_node.rate=240", ":="),
    (f"{SET} rate:=240", "write it as NODE.NAME:=VALUE"),
    (
        "run --duration 1 --in-process --throw 'mass=2 speed=8 at=0.9 target=chset'",
        *("throw 'mass=2", "did you mean 'chest'"),
    ),
    (
        "run --in-process --behaviour ragdoll --set controller_node.behaviour:=reactive",
        *("--behaviour is ragdoll", "reactive", "give one of them"),
    ),
    (
        "run --in-process --behaviour reactive --set controller_node.hit.threshold:=50",
        *("'limp.threshold' is 30 N s", "50 N s"),
    ),
]


def test_an_error_is_one_clear_line_and_leaves_nothing_behind(
    processes: Processes, tmp_path: Path
) -> None:
    command, *expected = WRONG[0]

    run = Run(processes, *shlex.split(command), "--output", str(tmp_path / "run"))

    assert run.process.wait() == 1
    assert all(part in run.error for part in expected)
    assert run.process.stderr.splitlines() == [run.error]
    assert run.family == {}
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("wrong", WRONG, ids=lambda wrong: wrong[0])
def test_every_error_says_what_was_wrong_and_what_would_have_been_right(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, own_handlers: None, wrong: tuple[str, ...]
) -> None:
    command, *expected = wrong

    code = main([*shlex.split(command), "--output", str(tmp_path / "run")])

    (line,) = capsys.readouterr().err.splitlines()
    assert code == 1
    assert line.startswith("error: ")
    assert all(part in line for part in expected), line
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("way", "process", "node"),
    [
        ((), "sim_node", ""),
        pytest.param(("--composed",), "composed", "sim_node: ", marks=pytest.mark.nightly),
    ],
)
def test_a_divergence_ends_the_run_with_the_simulators_own_message(
    processes: Processes, tmp_path: Path, way: tuple[str, ...], process: str, node: str
) -> None:
    run = Run(processes, *ENDLESS, *way, "--output", "run", "--set", "sim_node.speed_limit:=0.01")

    assert run.process.wait() == 1
    assert f"{process} failed: {node}diverged at tick 2: 'hinge'" in run.error
    assert run.family == {}
    list(read_messages(tmp_path / "run" / "bag"))


# The end that it does not choose

NIGHTLY, OTHERS = pytest.mark.nightly, ("sim_node", "controller_node", "composed")


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=NIGHTLY)])
def test_a_signal_ends_it_in_seconds_and_keeps_what_was_recorded(
    processes: Processes, tmp_path: Path, number: signal.Signals
) -> None:
    run = Run(processes, *LONG_WALK, "--output", "run").wait_for_ticks(tmp_path / "run")

    run.process.send(number)

    assert run.process.wait(SECONDS) == 130
    assert "Traceback" not in run.process.stderr
    assert run.family == {}
    recorded = read_messages(tmp_path / "run" / "bag", ["/joint_states"])
    ticks = list(dict.fromkeys(tick_of(message.decode()) for message in recorded))
    assert len(ticks) > 50
    assert ticks == list(range(1, len(ticks) + 1))


@pytest.mark.nightly
def test_without_a_bag_no_process_records_and_a_signal_keeps_the_figures(
    domain: int, processes: Processes, context: Context, tmp_path: Path
) -> None:
    own = {"ROS_DOMAIN_ID": str(domain)}
    run = Run(processes, *LONG_WALK, "--no-record", "--output", "run", **own)
    client = Client(context)
    states = client.listen(topics.JOINT_STATES)
    # Of ticks: the first state is published again and again until all have heard it. On a busy
    # machine some of the last ones are still on their way at the signal.
    client.spin_until(lambda: len(states) and tick_of(states.last) > 300, "states of the run")
    client.close()

    modules = {command.split(" -m ")[1].split()[0] for command in run.family.values()}
    assert modules == {"actuated_characters.cli", "sim_node.main", "controller_node.main"}
    run.process.send(signal.SIGINT)
    assert run.process.wait(SECONDS) == 130
    assert "Traceback" not in run.process.stderr
    assert run.family == {}
    assert summary_of(tmp_path / "run")["ticks"] > 90


def test_no_process_outlives_a_run_that_is_killed(processes: Processes, tmp_path: Path) -> None:
    run = Run(processes, *LONG_WALK, "--output", "run").wait_for_ticks(tmp_path / "run")
    assert len(run.family) == 4

    run.process.send(signal.SIGKILL)

    wait_until(lambda: run.family == {}, "the end of all its processes", SECONDS)


@pytest.mark.parametrize(
    "node", ["recorder", *(pytest.param(name, marks=NIGHTLY) for name in OTHERS)]
)
def test_a_node_that_is_killed_ends_the_run_and_is_named(
    processes: Processes, tmp_path: Path, node: str
) -> None:
    way = ("--composed",) if node == "composed" else ()
    run = Run(processes, *LONG_WALK, *way, "--output", "run").wait_for_ticks(tmp_path / "run")

    os.kill(run.pid_of(MODULES[node]), signal.SIGKILL)

    assert run.process.wait(SECONDS) == 1
    assert f"{node} failed: killed by SIGKILL" in run.error
    assert run.family == {}
    if node != "recorder":
        assert len(list(read_messages(tmp_path / "run" / "bag", ["/joint_states"]))) > 50
