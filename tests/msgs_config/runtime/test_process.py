"""What a node takes from its environment and its command line."""

from pathlib import Path
from xml.etree import ElementTree

import pytest

from msgs_config.runtime.process import middleware_settings
from tests.support.ros import DDS_PROFILES, RANGE, Processes

LOCALHOST = {RANGE: "LOCALHOST"}
FOLDER = Path(__file__).parents[3] / "msgs_config/runtime"
ANYWHERE_FILE, LOCALHOST_FILE = FOLDER / "fastdds.xml", FOLDER / "fastdds_localhost.xml"
PATIENT = {RANGE: "SYSTEM_DEFAULT", DDS_PROFILES: str(LOCALHOST_FILE)}
ANYWHERE = {DDS_PROFILES: str(ANYWHERE_FILE)}


@pytest.mark.parametrize(
    ("environment", "settings"),
    [
        ({}, ANYWHERE),
        ({RANGE: "SUBNET"}, ANYWHERE),
        (LOCALHOST, PATIENT),
        (LOCALHOST | {"RMW_IMPLEMENTATION": "rmw_fastrtps_cpp"}, PATIENT),
        (LOCALHOST | ANYWHERE, PATIENT),  # as a process of ours has left it
        (PATIENT, {}),
        (ANYWHERE, {}),
        (LOCALHOST | {"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"}, ANYWHERE),
        (LOCALHOST | {"ROS_STATIC_PEERS": "192.0.2.7"}, ANYWHERE),
        (LOCALHOST | {"ROS_LOCALHOST_ONLY": "1"}, ANYWHERE),
        (LOCALHOST | {DDS_PROFILES: "mine.xml"}, {}),
    ],
)
def test_on_one_machine_shared_memory_is_patient_unless_the_user_has_other_wishes(
    environment: dict[str, str], settings: dict[str, str]
) -> None:
    assert middleware_settings(environment) == settings


def test_both_files_have_the_same_timers() -> None:
    def timers(file: Path) -> dict[str, str]:
        tree = ElementTree.parse(file)
        names = ("leaseAnnouncement", "data_writer", "data_reader")
        found = {
            name: "".join(each.itertext()).split()
            for name in names
            for each in tree.iter()
            if each.tag.endswith(name)
        }
        assert sorted(found) == sorted(names)
        return {name: " ".join(values) for name, values in found.items()}

    assert timers(ANYWHERE_FILE) == timers(LOCALHOST_FILE)


@pytest.mark.parametrize(
    ("arguments", "output"),
    [
        (["humanoid"], "unknown argument 'humanoid'; "),
        (["--ros-args", "-p", "humanoid"], "ROS does not take the arguments: "),
    ],
)
def test_a_wrong_argument_is_one_line(
    processes: Processes, arguments: list[str], output: str
) -> None:
    node = processes.python("-m", "sim_node.main", *arguments)

    assert node.wait() == 1
    (line,) = node.stderr.splitlines()
    assert line.startswith(f"error: {output}")
