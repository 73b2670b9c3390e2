"""What the simulator's node warns of: what it lacks, what it cannot do, in lines that end."""

import re
from pathlib import Path

from msgs_config.messages import topics
from tests.sim_node.conftest import Join
from tests.support.ros import Process, Processes, SimulatorClient, stamp_ns, wait_until
from tests.support.urdf import joint, link, robot, write_character

LONGEST = 1100  # characters of a line: of a sentence's beginning, and what stands before it


def lines_with(node: Process, words: str) -> list[str]:
    return [line for line in node.stderr.splitlines() if words in line]


def test_a_simulator_that_lacks_subscribers_says_how_many_once_and_begins_when_they_are_there(
    processes: Processes, client: SimulatorClient, join: Join
) -> None:
    node = processes.simulator(wait_for_subscribers=2)

    wait_until(lambda: "waiting for" in node.stderr, "the warning")
    # as many as had been discovered by then: on a busy machine that may be none
    assert re.search("waiting for 2 subscribers of joint_states; there are [01];", node.stderr)
    client.get_parameters(topics.SIM_NODE, ["rate"])  # what has come by now is received with it
    assert len(client.states) == 0
    second = join("second")

    assert stamp_ns(second.state(1)) == stamp_ns(client.state(1))
    assert len(lines_with(node, "subscribers")) == 1


def test_a_simulator_alone_says_what_was_repaired_and_that_it_begins_below_the_ground(
    processes: Processes, client: SimulatorClient, tmp_path: Path
) -> None:
    """A ball of 0.5 m whose centre is 0.2 m above the ground; a `run` says so by itself."""
    thin = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="5"/></inertial>'
    ball = '<collision><geometry><sphere radius="0.5"/></geometry></collision>'
    file = str(
        write_character(tmp_path, robot(link("ball", thin + ball)), "rest_pose: {root_z: 0.2}\n")
    )

    alone = processes.simulator(file, wait_for_subscribers=1)  # no motor: no state waits else
    client.first_state()

    (line,) = lines_with(alone, "below the ground")
    assert "link 'ball' is 0.3 m deep" in line
    (line,) = lines_with(alone, "no body can have")
    assert "ball (1, 1, 5) -> (" in line


def test_a_name_that_is_unknown_among_very_many_is_answered_in_a_line_that_ends(
    processes: Processes, client: SimulatorClient, tmp_path: Path
) -> None:
    names = [f"the_joint_before_segment_{number}" for number in range(60)]
    chain = [link("segment_0")]
    for number, name in enumerate(names):
        chain.append(link(f"segment_{number + 1}"))
        chain.append(joint(name, f"segment_{number}", f"segment_{number + 1}"))

    node = processes.simulator(str(write_character(tmp_path, robot(*chain))))
    state = client.first_state()
    client.command(stamp_ns(state), {"tail": 1.0})
    client.reported(answering=state, rejected=1)

    (line,) = lines_with(node, "rejected")
    assert "unknown" in line and "'tail'" in line and names[0] in line
    assert line.endswith(" ...") and len(line) < LONGEST
