"""The command line, as a user calls it: what a run leaves behind, and how it ends when it must."""

import json
import math
import os
import re
import signal
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy
import yaml
from rclpy.context import Context

from actuated_characters.bags.reader import read_messages
from actuated_characters.cli import main
from actuated_characters.metrics.run_metrics import StateHash
from actuated_characters.runs.plan import make_plan
from msgs_config.character.loading import load_character
from msgs_config.messages import topics
from msgs_config.messages.joint_state import JointStateDecoder, state_in_layout
from tests.support.physics import controller, run_together, simulation
from tests.support.ros import Client, Process, Processes, stamp_ns, tick_of, wait_until

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
ONE_CHUNK = 500_000  # bytes; a bag goes to the disk in pieces of about 1 MB
SECONDS = 10.0  # that a run may take to end when it must
_FAMILY = "ACTUATED_CHARACTERS_TEST"  # an environment variable that all of a run's processes have


class Run:
    """A run, and the processes that it has started."""

    def __init__(self, processes: Processes, *arguments: str, **environment: str) -> None:
        self._mark = uuid.uuid4().hex
        inherited = {name: value for name, value in os.environ.items() if name != "ROS_DOMAIN_ID"}
        self.process: Process = processes.command(
            *arguments, environment=inherited | environment | {_FAMILY: self._mark}
        )

    @property
    def family(self) -> dict[int, str]:
        """Command lines of all its processes that live, by pid."""
        mark = f"{_FAMILY}={self._mark}".encode()
        found = {}
        for entry in Path("/proc").iterdir():
            if not entry.name.isdecimal():
                continue
            try:
                if mark in (entry / "environ").read_bytes().split(b"\0"):
                    found[int(entry.name)] = (entry / "cmdline").read_text().replace("\0", " ")
            except OSError:  # it has ended, or is somebody else's
                continue
        return found

    def pid_of(self, module: str) -> int:
        """The process that runs a module."""
        (pid,) = [pid for pid, command in self.family.items() if f"-m {module} " in command]
        return pid

    def finish(self) -> "Run":
        """Wait for a good end."""
        assert self.process.wait(120.0) == 0, self.process.stderr
        return self

    @property
    def error(self) -> str:
        """Its error, which is all that it has to say, in one line."""
        assert "Traceback" not in self.process.stderr
        errors = [line for line in self.process.stderr.splitlines() if "error" in line.lower()]
        (line,) = errors
        assert line.startswith("error: ")
        return line

    def wait_for_ticks(self, directory: Path) -> "Run":
        """Wait until it is well under way: the first chunk of its bag has gone to the disk."""
        bag = directory / "bag" / "bag.mcap"
        wait_until(lambda: bag.exists() and bag.stat().st_size > ONE_CHUNK, "ticks of the run")
        return self


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
def unassisted(together: Processes, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same without root assistance and without a bag."""
    directory = tmp_path_factory.mktemp("unassisted")
    switch = ("--set", "controller_node.root_assistance:=false")
    Run(together, *WALK, *switch, "--no-record", "--output", str(directory)).finish()
    return directory


def summary_of(directory: Path) -> dict[str, Any]:
    return dict(json.loads((directory / "summary.json").read_text()))


def parameters_of(directory: Path, node: str) -> dict[str, Any]:
    content = yaml.safe_load((directory / "parameters" / f"{node}.yaml").read_text())
    return dict(content[node]["ros__parameters"])


# What a run leaves behind


def test_the_summary_has_every_figure_and_they_are_sane(walk: Path) -> None:
    figures = summary_of(walk)

    assert set(figures) >= FIGURES
    assert figures["ticks"] == TICKS
    assert figures["sim_time_s"] == pytest.approx(2.0, abs=1e-8)
    assert figures["real_time_factor"] == pytest.approx(2.0 / figures["wall_time_s"])
    assert figures["fell"] is False
    assert 0.0 < figures["joint_error_mean_rad"] <= 0.08
    assert 0.0 < figures["root_error_mean_m"] <= 0.055
    assert figures["root_error_mean_m"] < figures["root_error_max_m"] < 0.2
    assert figures["body_weight_n"] == pytest.approx(45.0 * 9.81, rel=0.001)
    assert 0.0 < figures["assist_force_mean_n"] <= 0.56 * figures["body_weight_n"]
    assert 0.0 <= figures["saturated_fraction"] < 0.05
    assert figures["rejected_commands"] == figures["duplicate_commands"] == 0
    assert len(bytes.fromhex(figures["state_hash"])) == 32


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


def test_the_bag_holds_every_tick_of_every_stream(walk: Path) -> None:
    ticks: dict[str, list[int]] = {}
    for message in read_messages(walk / "bag"):
        decoded = message.decode()
        if hasattr(decoded, "clock"):
            ticks.setdefault(message.topic, []).append(round(stamp_ns_of_clock(decoded) * 24e-8))
        elif hasattr(decoded, "header") and message.topic != "/diagnostics":
            ticks.setdefault(message.topic, []).append(tick_of(decoded))
        else:
            ticks.setdefault(message.topic, [])

    def unrepeated(topic: str) -> list[int]:
        return list(dict.fromkeys(ticks[topic]))

    assert set(ticks) >= {"/sim_node/configuration", "/controller_node/configuration", "/episode"}
    assert unrepeated("/joint_states") == list(range(1, TICKS + 2))
    assert unrepeated("/clock") == list(range(1, TICKS + 2))
    assert unrepeated("/joint_torques")[:TICKS] == list(range(1, TICKS + 1))
    assert unrepeated("/controller_node/reference")[:TICKS] == list(range(1, TICKS + 1))


def stamp_ns_of_clock(message: Any) -> int:
    return int(message.clock.sec) * 10**9 + int(message.clock.nanosec)


def test_the_state_hash_can_be_computed_from_the_bag(walk: Path) -> None:
    layout = load_character("humanoid").layout
    decoder, state_hash, last = JointStateDecoder(), StateHash(), 0

    for message in read_messages(walk / "bag", ["/joint_states"]):
        state = state_in_layout(layout, decoder.decode(message.raw))
        if state.stamp_ns > last:
            state_hash.add(state)
            last = state.stamp_ns

    assert state_hash.hexdigest() == summary_of(walk)["state_hash"]


def test_in_one_process_without_ros_the_states_are_the_same_to_the_bit(
    walk: Path, together: Processes, tmp_path: Path
) -> None:
    run = Run(together, *WALK, "--in-process", "--output", str(tmp_path / "run")).finish()

    over_topics, in_process = summary_of(walk), summary_of(tmp_path / "run")
    assert "ROS_DOMAIN_ID" not in run.process.stdout
    assert set(in_process) == set(over_topics)
    for figure in set(in_process) - {"wall_time_s", "real_time_factor"}:
        assert in_process[figure] == over_topics[figure]


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


def test_no_answer_is_waited_for_for_ever(walk: Path) -> None:
    assert parameters_of(walk, "sim_node")["lockstep_timeout"] > 0.0


def test_without_root_assistance_the_walk_falls(unassisted: Path) -> None:
    figures = summary_of(unassisted)

    assert figures["ticks"] == TICKS
    assert figures["fell"] is True
    assert figures["assist_force_mean_n"] == 0.0
    assert "root" not in parameters_of(unassisted, "sim_node")["commanded_joints"]
    assert parameters_of(unassisted, "controller_node")["root_assistance"] is False


def test_without_a_bag_all_figures_are_there(unassisted: Path, walk: Path) -> None:
    assert not (unassisted / "bag").exists()
    assert set(summary_of(unassisted)) == set(summary_of(walk))
    assert (unassisted / "plot.png").exists()


def test_root_that_is_not_commanded_switches_assistance_off() -> None:
    joints = load_character("humanoid").layout.actuated_joint_names

    plan = make_plan("humanoid", 2.0, {"reference": "hold"}, {"commanded_joints": joints}, {})

    assert plan.controller.flag("root_assistance") is False


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


@pytest.fixture
def own_handlers() -> Iterator[None]:
    """The command line sets a signal handler; here it is in the test's own process."""
    handler = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, handler)


def test_results_are_not_overwritten_unasked(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, own_handlers: None
) -> None:
    arguments = [*SHORT, "--output", str(tmp_path / "run")]
    assert main(arguments) == 0
    before = summary_of(tmp_path / "run")

    code = main(arguments)

    assert code == 1
    assert "error: " in (errors := capsys.readouterr().err) and "--overwrite" in errors
    assert summary_of(tmp_path / "run") == before


def test_overwriting_replaces_the_results_and_leaves_nothing_of_them(
    tmp_path: Path, own_handlers: None
) -> None:
    directory = tmp_path / "run"
    (directory / "bag").mkdir(parents=True)
    (directory / "bag" / "bag.mcap").write_text("old")
    (directory / "summary.json").write_text('{"ticks": "old"}')

    code = main([*SHORT, "--overwrite", "--output", str(directory)])

    assert code == 0
    assert summary_of(directory)["ticks"] == 24
    assert not (directory / "bag").exists()


def test_files_that_are_no_results_are_never_deleted(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, own_handlers: None
) -> None:
    directory = tmp_path / "thesis"
    directory.mkdir()
    (directory / "thesis.tex").write_text("years of work")
    (directory / "summary.json").write_text("{}")

    code = main([*SHORT, "--overwrite", "--output", str(directory)])

    assert code == 1
    assert str(directory) in capsys.readouterr().err
    assert {path.name for path in directory.iterdir()} == {"thesis.tex", "summary.json"}
    assert (directory / "thesis.tex").read_text() == "years of work"


# Errors


def setting(text: str) -> tuple[str, ...]:
    return (*ENDLESS, "--set", text)


COMMANDED = "sim_node.commanded_joints:="
ALL_JOINTS = f"{COMMANDED}{load_character('humanoid').layout.joint_names}"
WRONG: dict[str, tuple[tuple[str, ...], list[str]]] = {
    "character": (("run", "--character", "centaur"), ["'centaur'", "humanoid", "pendulum"]),
    "clip": (("run", "--clip", "swim"), ["'swim'", "walk", "backflip"]),
    "clip of another character": ((*ENDLESS, "--clip", "walk"), ["pendulum"]),
    "node": (setting("simulator.rate:=480"), ["'simulator'", "sim_node, controller_node"]),
    "parameter": (setting("sim_node.frition:=1.0"), ["'frition'", "friction"]),
    "value": (setting("sim_node.friction:=rough"), ["'friction'", "'rough'", "number"]),
    "gain": (setting("controller_node.gains.hinge.p:=-5.0"), ["'gains.hinge.p'", "-5.0"]),
    "gain of no joint": (setting("controller_node.gains.tail.p:=5.0"), ["tail", "gains.hinge.p"]),
    "joint": (setting("sim_node.commanded_joints:=[tail]"), ["'tail'", "hinge"]),
    "joints that the controller does not command": (
        ("run", "--set", "controller_node.root_assistance:=false", "--set", ALL_JOINTS),
        ["commanded_joints", "root"],
    ),
    "joints that only the controller commands": (
        (
            "run",
            "--character",
            "franka_panda",
            "--set",
            "sim_node.commanded_joints:=[panda_joint1]",
        ),
        ["commanded_joints", "panda_joint2"],
    ),
    "duration": (("run", "--character", "pendulum", "--duration", "0"), ["duration", "0.0 s"]),
    "duration is no number": (("run", "--character", "pendulum", "--duration", "nan"), ["nan"]),
    "end": (setting("sim_node.max_ticks:=0"), ["'max_ticks'", "--duration"]),
    "initial state": (
        setting("sim_node.initial_state:=reference"),
        ["'initial_state'", "the run itself", "initial_position"],
    ),
    "two rates": (
        (*setting("sim_node.rate:=240"), "--set", "controller_node.rate:=480"),
        ["'rate'", "240", "480"],
    ),
    "real time in one process": (
        (*SHORT, "--set", "sim_node.mode:=realtime"),
        ["--in-process", "'mode' realtime"],
    ),
    "pace in one process": (
        (*SHORT, "--set", "sim_node.real_time_factor:=1.0"),
        ["--in-process", "'real_time_factor'"],
    ),
    "topic without a bag": ((*SHORT, "--topic", "/mine"), ["--topic", "--in-process"]),
    "storage of no bag": (
        (*ENDLESS, "--storage", "sqlite3", "--no-record"),
        ["--storage", "--no-record"],
    ),
    "topic to exclude": ((*ENDLESS, "--exclude", "contcts"), ["'contcts'", "mean 'contacts'"]),
    "topic that is needed": ((*ENDLESS, "--exclude", "joint_states"), ["'joint_states'"]),
    "unfinished setting": (setting("sim_node.rate=240"), ["sim_node.rate=240", ":="]),
}


@pytest.mark.parametrize("wrong", ["character", "gain"])
def test_an_error_is_one_clear_line_and_leaves_nothing_behind(
    processes: Processes, tmp_path: Path, wrong: str
) -> None:
    arguments, expected = WRONG[wrong]

    run = Run(processes, *arguments, "--output", str(tmp_path / "run"))

    assert run.process.wait() == 1
    assert all(part in run.error for part in expected)
    assert run.process.stderr.splitlines() == [run.error]
    assert run.family == {}
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("wrong", WRONG)
def test_every_error_says_what_was_wrong_and_what_would_have_been_right(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, own_handlers: None, wrong: str
) -> None:
    arguments, expected = WRONG[wrong]

    code = main([*arguments, "--output", str(tmp_path / "run")])

    (line,) = capsys.readouterr().err.splitlines()
    assert code == 1
    assert line.startswith("error: ")
    assert all(part in line for part in expected)
    assert not (tmp_path / "run").exists()


def test_a_divergence_ends_the_run_with_the_simulators_own_message(
    processes: Processes, tmp_path: Path
) -> None:
    run = Run(processes, *ENDLESS, "--output", "run", "--set", "sim_node.speed_limit:=0.01")

    assert run.process.wait() == 1
    assert "sim_node failed: diverged at tick 2: 'hinge'" in run.error
    assert run.family == {}
    list(read_messages(tmp_path / "run" / "bag"))


# The end that it does not choose


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
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


def test_no_process_outlives_a_run_that_is_killed(processes: Processes, tmp_path: Path) -> None:
    run = Run(processes, *LONG_WALK, "--output", "run").wait_for_ticks(tmp_path / "run")
    assert len(run.family) == 4

    run.process.send(signal.SIGKILL)

    wait_until(lambda: run.family == {}, "the end of all its processes", SECONDS)


@pytest.mark.parametrize(
    ("node", "module"),
    [
        ("sim_node", "sim_node.main"),
        ("controller_node", "controller_node.main"),
        ("recorder", "actuated_characters.recorder.main"),
    ],
)
def test_a_node_that_is_killed_ends_the_run_and_is_named(
    processes: Processes, tmp_path: Path, node: str, module: str
) -> None:
    run = Run(processes, *LONG_WALK, "--output", "run").wait_for_ticks(tmp_path / "run")

    os.kill(run.pid_of(module), signal.SIGKILL)

    assert run.process.wait(SECONDS) == 1
    assert f"{node} failed: killed by SIGKILL" in run.error
    assert run.family == {}
    if node != "recorder":
        assert len(list(read_messages(tmp_path / "run" / "bag", ["/joint_states"]))) > 50


# What there is to run


def test_the_list_shows_characters_and_clips(processes: Processes) -> None:
    listing = processes.command("list", environment={**os.environ, "COLUMNS": "300"})

    assert listing.wait() == 0
    for name in ("humanoid", "franka_panda", "lift", "pendulum", "walk", "backflip", "cartwheel"):
        assert name in listing.stdout
    assert "34, floating base" in listing.stdout


def test_everything_is_on_this_machine_and_finite_in_the_summary(walk: Path) -> None:
    figures = summary_of(walk)

    assert all(math.isfinite(v) for v in figures.values() if isinstance(v, float))
