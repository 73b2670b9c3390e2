"""Characters and simulations are the same in any process: locale, threads, forks, no output."""

from pathlib import Path

import pytest

from sim_node.physics.engine import INSTALLED_ENGINES
from tests.support import engines
from tests.support.locales import compile_decimal_comma
from tests.support.programs import output_of, run_program
from tests.support.urdf import inertial, joint, link, robot

pytestmark = pytest.mark.slow

WEDGE = """
v 0.0 0.0 0.0\nv 0.25 0.0 0.0\nv 0.0 0.25 0.0\nv 0.0 0.0 0.25
f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4
"""
SHAPES = """
<visual><geometry><mesh filename="wedge.obj" scale="0.5 0.5 0.5"/></geometry></visual>
<collision><geometry><mesh filename="wedge.obj" scale="0.5 0.5 0.5"/></geometry></collision>
"""
GROUND = """
<collision><origin xyz="0 0 -0.25"/><geometry><box size="9.5 9.5 0.5"/></geometry></collision>
"""
READINGS = """
import hashlib, locale, sys, threading
import numpy as np
import actuated_characters as ac
from actuated_characters.render.engine.renderer import Renderer
from msgs_config.messages.throw import ProjectileThrow
from tests.support.pictures import take_picture

robot, ground = sys.argv[1:3]

def readings(character):
    yield character.mass, character.links[1].inertia_diagonal, character.links[1].joint.lower
    with ac.Simulation(character, terrain=ground) as simulation:
        for episode in range(2):  # a reset builds another world
            for _ in range(120):
                simulation.step([0.3])
            simulation._simulation.step([np.zeros(1)], None, [
                ProjectileThrow(1.5, 0.12, (0.1, 0.1, 2.5), (0.0, 0.0, -3.5))])
            touches = 0
            for _ in range(120):
                simulation.step([0.3])
                touches += bool(simulation.contacts.any())
            yield simulation.state_hash, f"{touches} ticks in touch"
            simulation.reset()
    camera = Renderer(character)
    picture = take_picture(camera, np.zeros(1), size=(160, 120))
    yield hashlib.sha256(picture.tobytes()).hexdigest()

def report(character=None):
    print([*readings(character or ac.load_character(robot))], flush=True)

loaded = ac.load_character(robot)
report()
for name in sys.argv[3:]:
    locale.setlocale(locale.LC_ALL, name)
    report()
    report(loaded)
    other = threading.Thread(target=report)
    other.start()
    other.join()
    assert locale.setlocale(locale.LC_NUMERIC) == name
    assert locale.localeconv()["decimal_point"] == ","
"""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    """A robot with a mesh on a hinge, and a terrain for it."""
    folder = tmp_path_factory.mktemp("robot")
    (folder / "wedge.obj").write_text(WEDGE)
    axis = '<origin xyz="0.05 0 0.02" rpy="0.1 0.2 0.3"/><axis xyz="0 1 0"/>'
    (folder / "swing.urdf").write_text(
        robot(
            link("world", ""),
            joint("hinge", "world", "arm", inside=axis),
            link("arm", inertial(0.75, 1.5, '<origin xyz="0.1 0 -0.3"/>') + SHAPES),
        )
    )
    (folder / "ground.urdf").write_text(robot(link("ground", inertial(0) + GROUND)))
    return str(folder / "swing.urdf"), str(folder / "ground.urdf")


def test_numbers_are_read_alike_in_a_locale_with_a_decimal_comma(
    files: tuple[str, str], tmp_path: Path
) -> None:
    environment = compile_decimal_comma(tmp_path)
    lines = output_of(READINGS, *files, "de_DE.UTF-8", environment=environment).splitlines()
    assert len(lines) == 4
    assert lines == [lines[0]] * 4
    assert "0.75" in lines[0]
    assert "'0 ticks in touch" not in lines[0]


THREADS = """
import os, sys, threading
import actuated_characters as ac

before = [os.readlink(f"/proc/self/fd/{number}") for number in (1, 2)]
hashes, loading = [], threading.Barrier(4)

def load_and_simulate():
    loading.wait()
    for _ in range(4):
        character = ac.load_character("humanoid")
        with ac.Simulation(character, start=None, gravity=3.0) as simulation:
            simulation.reset()
            for _ in range(20):
                simulation.step([1.0] * 34)
            hashes.append(simulation.state_hash)

def talk():
    loading.wait()
    number = 0
    while any(thread.is_alive() for thread in loaders):
        number += 1
        print("line", number, flush=True)
        os.write(2, b"raw\\n")
    print("lines", number)

loaders = [threading.Thread(target=load_and_simulate) for _ in range(3)]
talker = threading.Thread(target=talk)
for thread in (*loaders, talker):
    thread.start()
for thread in (*loaders, talker):
    thread.join()
assert len(hashes) == 12 and len(set(hashes)) == 1
assert before == [os.readlink(f"/proc/self/fd/{number}") for number in (1, 2)]
print("the last line")
"""


def test_threads_lose_no_output_while_others_load() -> None:
    ended = run_program(THREADS)
    *lines, total, last = ended.stdout.splitlines()
    assert ended.returncode == 0
    assert last == "the last line"
    assert lines == [f"line {number}" for number in range(1, len(lines) + 1)]
    assert total == f"lines {len(lines)}"
    assert ended.stderr == "raw\n" * len(lines)


WORLDS_IN_THREADS = """
import threading, time
import actuated_characters as ac
from sim_node.physics.bullet.client import pybullet

def walk(threshold, hashes):
    character = ac.load_character("humanoid")
    given = {"contact_breaking_threshold": threshold, "commanded_joints": []}
    with ac.Simulation(character, parameters=given) as simulation:
        for _ in range(150):
            simulation.step([0.0] * 34)
        hashes[threshold] = simulation.state_hash

thresholds, alone, together = (0.02, 0.001), {}, {}
for threshold in thresholds:
    walk(threshold, alone)
set_parameter = pybullet.setPhysicsEngineParameter

def set_and_let_others_go_on(**parameters):
    set_parameter(**parameters)
    time.sleep(1e-3)

pybullet.setPhysicsEngineParameter = set_and_let_others_go_on
threads = [threading.Thread(target=walk, args=(each, together)) for each in thresholds]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
assert len(set(alone.values())) == 2
assert alone == together
"""


@engines.needs_bullet
def test_worlds_of_other_settings_in_threads_are_as_alone() -> None:
    output_of(WORLDS_IN_THREADS)


FORK = """
import os, threading, warnings
import actuated_characters as ac

warnings.simplefilter("ignore", DeprecationWarning)  # of a fork while there are threads

def ten_steps(simulation):
    for _ in range(10):
        simulation.step([1.0])
    return simulation.state_hash

character = ac.load_character("pendulum")
simulation = ac.Simulation(character)
simulation.step([1.0])
stop = threading.Event()
loader = threading.Thread(target=lambda: [ac.load_character("pendulum") for _ in range(40)])
loader.start()
readings = []
for _ in range(8):  # while another thread loads
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        ac.load_character("pendulum")
        os.write(writing, ten_steps(simulation).encode())
        simulation.close()
        os._exit(0)
    os.close(writing)
    with open(reading) as pipe:
        readings.append(pipe.read())
    assert os.waitpid(child, 0)[1] == 0
loader.join()
assert readings == [ten_steps(simulation)] * 8
"""


def test_a_forked_process_has_a_simulation_that_is_its_own() -> None:
    output_of(FORK)


WITHOUT_STREAMS = """
import os, sys
{closed}
import actuated_characters as ac
with ac.Simulation(ac.load_character("pendulum")) as simulation:
    simulation.step([0.0])
with open(sys.argv[1], "w") as file:
    file.write(simulation.state_hash)
"""
CLOSED = {
    "none of Python's": "sys.stdout = sys.stderr = None",
    "no standard output": "os.close(1)",
    "no error output": "os.close(2)",
    "no stream at all": "sys.stdout = sys.stderr = None; [os.close(number) for number in range(3)]",
}


@pytest.fixture(scope="module")
def with_streams(tmp_path_factory: pytest.TempPathFactory) -> str:
    """What it writes where all streams are open."""
    file = tmp_path_factory.mktemp("open") / "written"
    run_program(WITHOUT_STREAMS.format(closed=""), str(file))
    return file.read_text()


@pytest.mark.parametrize("closed", CLOSED.values(), ids=CLOSED)
def test_characters_load_where_there_is_no_output(
    closed: str, with_streams: str, tmp_path: Path
) -> None:
    run_program(WITHOUT_STREAMS.format(closed=closed), str(tmp_path / "closed"))
    assert (tmp_path / "closed").read_text() == with_streams != ""


COMMANDS = """
import os, sys
for number in map(int, sys.argv[1]):
    os.close(number)
commands = '''
import sys
from actuated_characters.cli import main
run = ["run", "--character", "pendulum", "--duration", "0.1", "--in-process", "--output"]
codes = main(["run"]), main(["info", sys.argv[1] + "/nothing"]), main([*run, sys.argv[1]])
assert codes == (0, 1, 0)
'''
os.execv(sys.executable, [sys.executable, "-c", commands, *sys.argv[2:]])
"""


@pytest.mark.parametrize("closed", ["1", "2", "012"])
def test_commands_run_where_there_is_no_output(closed: str, tmp_path: Path) -> None:
    assert run_program(COMMANDS, closed, str(tmp_path / "run")).returncode == 0
    assert (tmp_path / "run" / "summary.json").stat().st_size > 0


@pytest.mark.parametrize("engine", INSTALLED_ENGINES)
def test_the_import_of_an_engine_says_nothing(engine: str) -> None:
    assert output_of(f"import sim_node.physics.{engine}.world") == ""
