"""The files of controllers and of sets of trials: what they mean, and the line for each mistake."""

from pathlib import Path

import pytest

from actuated_characters.commands.common.row_runs import asked_run, row_options
from actuated_characters.trial.controller_file import Controller, check_program, read_controller
from actuated_characters.trial.row import Trial
from actuated_characters.trial.trial_set import TrialSet, find_set, read_set, shipped_sets
from msgs_config.errors import ConfigurationError
from tests.support.programs import PROJECT

PENDULUM = "command: [sleep, '1']\nrun: {character: pendulum}\n"
EXAMPLES = sorted((PROJECT / "examples" / "trials").glob("*.yaml"))


def controller(folder: Path, text: str = PENDULUM) -> Controller:
    file = folder / "mine.yaml"
    file.write_text(text, "utf-8")
    return read_controller(file)


def trials(folder: Path, text: str, of: Controller | None = None) -> TrialSet:
    file = folder / "hard.yaml"
    file.write_text(text, "utf-8")
    return read_set(file, of or controller(folder), row_options(), "mujoco")


def test_a_command_is_a_text_or_a_list_and_runs_beside_its_file(tmp_path: Path) -> None:
    as_text = controller(tmp_path, "command: sleep '1 2'")
    as_list = controller(tmp_path, "command: [sleep, '1 2']")

    assert as_text == as_list
    assert as_text.foreign is not None
    assert as_text.foreign.command == ("sleep", "1 2")
    assert (as_text.name, as_text.folder) == ("mine", tmp_path)


def test_another_file_or_command_is_another_controller(tmp_path: Path) -> None:
    (tmp_path / "law.py").write_text("kp = 1")
    first = controller(tmp_path, "command: ['{python}', law.py]")
    before = first.fingerprint()

    assert before == controller(tmp_path, "command: ['{python}', law.py]  # mine").fingerprint()
    assert before != controller(tmp_path, "command: ['{python}', law.py, more]").fingerprint()
    (tmp_path / "law.py").write_text("kp = 22")
    assert before != first.fingerprint()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{}", "either 'command', which starts a controller, or 'controller_node'"),
        ("command: x\ncontroller_node: {clip: walk}", "either 'command'"),
        ("command: 7", "command is 7; it must be a command: a text, or a list of texts"),
        ("command: []", "it must be a command"),
        ("command: x 'y", "No closing quotation"),
        ("comand: x", "did you mean 'command'?"),
        ("command: x\nsubscriptions: 0", "subscriptions is 0; it must be a whole number"),
        ("command: x\nstart_timeout: soon", "start_timeout is 'soon'"),
        ("command: x\nenvironment: {A: 1}", "environment.A is 1; it must be a text"),
        ("controller_node: {}\nsubscriptions: 2", "subscriptions goes with 'command'"),
        ("controller_node: {clip: walk}\nrun: {clip: kick}", "controller_node.clip is in run, too"),
        ("[", "mine.yaml"),
    ],
)
def test_a_mistake_in_a_controller_s_file_is_one_line(
    tmp_path: Path, text: str, words: str
) -> None:
    with pytest.raises(ConfigurationError) as error:
        controller(tmp_path, text)

    assert words in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("command", ["no_such_program", "./no_such_program"])
def test_a_program_that_is_not_there_is_told_before_anything_runs(
    tmp_path: Path, command: str
) -> None:
    with pytest.raises(ConfigurationError, match=r"there is no program '(./)?no_such_program'"):
        check_program(tmp_path / "mine.yaml", controller(tmp_path, f"command: {command}"))


def test_kinds_add_to_what_all_have_and_rows_are_counted_through(tmp_path: Path) -> None:
    hard = trials(
        tmp_path,
        """
        goal: {at_end: {hinge: [0, 1]}}
        run: {duration: 2.0}
        values: {force: [10, 20]}
        trials:
          pushes: {run: {push: "rod:{force},0,0@1"}}
          gravity: {run: {duration: 1.0}, set: {sim_node.gravity: [9, 10]}, goal: {posture: any}}
        """,
    )

    assert [(row.number, *row.cells.values()) for row in hard.rows] == [
        *((1, "pushes", 10), (2, "pushes", 20)),
        *((3, "gravity", 9), (4, "gravity", 10)),
    ]
    assert hard.rows[1].arguments == (
        *("--duration=2.0", "--push=rod:20,0,0@1", "--character=pendulum"),
        "--set=sim_node.engine:=mujoco",
    )
    assert "--duration=1.0" in hard.rows[2].arguments
    assert hard.goals()[1].posture == "upright"
    assert (hard.goals()[4].posture, dict(hard.goals()[4].at_end)) == ("any", {"hinge": (0, 1)})
    assert hard.bags == "failures"


def test_the_file_of_a_sweep_is_a_set_of_one_kind(tmp_path: Path) -> None:
    assert {row.cells["kind"] for row in trials(tmp_path, "run: {duration: [1, 2]}").rows} == {
        "hard"
    }


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("trial: {}", "did you mean 'trials'?"),
        ("trials: {}", "trials is a dict; it must be a mapping of kinds"),
        ("trials: {a: {sets: {}}}", "did you mean 'set'?"),
        ("trials: {a: {run: {clp: walk}}}", "hard.yaml (a): unknown option of run 'run.clp'"),
        ("trials: {a: {goal: {fall: 1}}}", "hard.yaml (a): unknown key 'goal.fall'"),
        ("run: {character: humanoid}", "run.character is humanoid, and controller 'mine' needs"),
        ("values: {survived: [1, 2]}", "is the name of another column"),
        ("bags: some", "bags is 'some'"),
    ],
)
def test_a_mistake_in_a_set_is_one_line(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        trials(tmp_path, text)

    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_of_a_set_that_is_not_there_the_shipped_ones_are_named() -> None:
    with pytest.raises(ConfigurationError, match=r"did you mean 'standing'.*lift.*or the path"):
        find_set("standng")


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_each_row_of_the_examples_can_be(file: Path) -> None:
    example = read_controller(file)
    chosen = read_set(find_set(example.trials), example, row_options(), "mujoco")
    trial = Trial(example, chosen.goals(), asked_run)

    for kind in chosen.kinds:
        for row in kind.to_check():
            root = trial.check(row.number, row.arguments).plan.simulator["commanded_joints"]
            assert "root" not in root  # nobody holds the base by a force


@pytest.mark.parametrize("name", shipped_sets())
def test_each_shipped_set_has_an_engine_that_every_python_has(name: str, tmp_path: Path) -> None:
    own = controller(tmp_path, "controller_node: {planner: predictive}")
    if name == "lift":
        own = controller(tmp_path)
    chosen = read_set(find_set(name), own, row_options(), "bullet")
    trial = Trial(own, chosen.goals(), asked_run)

    assert all("--set=sim_node.engine:=mujoco" in row.arguments for row in chosen.rows)
    for kind in chosen.kinds:
        for row in kind.to_check():
            trial.check(row.number, row.arguments)


def test_values_for_all_kinds_may_have_names_in_any_alphabet(tmp_path: Path) -> None:
    text = (
        "values: {größe: [1, 2]}\n"
        'trials: {pushes: {run: {push: "chest:{größe},0,0@0.1"}}, rests: {run: {duration: 1.0}}}\n'
    )
    (tmp_path / "mine.yaml").write_text(text, "utf-8")
    (tmp_path / "own.yaml").write_text("controller_node: {}\n", "utf-8")
    own = read_controller(tmp_path / "own.yaml")

    chosen = read_set(tmp_path / "mine.yaml", own, row_options(), "mujoco")

    assert [len(kind.rows) for kind in chosen.kinds] == [2, 1]


def test_a_long_word_of_a_command_is_no_file(tmp_path: Path) -> None:
    words = "x" * 300
    (tmp_path / "mine.yaml").write_text(f"command: [bash, -c, {words}]\n", "utf-8")

    assert read_controller(tmp_path / "mine.yaml").digests() == {}


def test_a_set_that_a_controllers_file_names_is_beside_it(tmp_path: Path) -> None:
    assert find_set("sets/mine.yaml", tmp_path) == tmp_path / "sets" / "mine.yaml"
    assert find_set("lift", tmp_path) == find_set("lift")


def test_a_place_that_is_misspelt_is_named_and_braces_of_a_shell_are_left(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text('command: ["{pyton}", law.py]\n', "utf-8")
    with pytest.raises(ConfigurationError, match="command: unknown place 'pyton'"):
        read_controller(tmp_path / "mine.yaml")

    (tmp_path / "mine.yaml").write_text("command: [bash, -c, 'echo ${x} {a,b} {home}']\n", "utf-8")
    assert read_controller(tmp_path / "mine.yaml").foreign is not None
