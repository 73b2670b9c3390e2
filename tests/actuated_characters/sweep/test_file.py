"""The file of a sweep: what its rows are, and the line that each mistake gets."""

from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from actuated_characters.commands.common.row_runs import row_options
from actuated_characters.commands.common.settings import NODES, node_settings
from actuated_characters.sweep.file import Sweep, read_sweep
from actuated_characters.sweep.row import FIGURES
from msgs_config.errors import ConfigurationError
from tests.support.programs import PROJECT


def read(folder: Path, text: str) -> Sweep:
    file = folder / "sweep.yaml"
    file.write_text(text, "utf-8")
    return read_sweep(file, row_options(), FIGURES)


def test_an_empty_sweep_is_the_usual_run_once(tmp_path: Path) -> None:
    (row,) = read(tmp_path, "{}").rows()

    assert (row.number, row.arguments, dict(row.cells)) == (1, (), {})


def test_lists_are_a_grid_and_single_values_are_of_all_rows(tmp_path: Path) -> None:
    rows = read(
        tmp_path,
        """
        run: {clip: [walk, kick], duration: 2.0}
        set: {sim_node.friction: [0.8, 1.0], controller_node.planner: predictive}
        """,
    ).rows()

    assert [tuple(row.cells.values()) for row in rows] == [
        ("walk", 0.8),
        ("walk", 1.0),
        ("kick", 0.8),
        ("kick", 1.0),
    ]
    assert list(rows[0].cells) == ["clip", "sim_node.friction"]
    assert rows[1].arguments == (
        *("--clip=walk", "--duration=2.0", "--set=sim_node.friction:=1.0"),
        "--set=controller_node.planner:=predictive",
    )


def test_an_option_that_may_be_repeated_is_a_text_or_a_list_in_the_list(tmp_path: Path) -> None:
    rows = read(
        tmp_path, "run: {push: [none, 'chest:9,0,0@1', ['chest:9,0,0@1', 'chest:0,9,0@2']]}"
    ).rows()

    assert [row.arguments for row in rows] == [
        ("--push=none",),
        ("--push=chest:9,0,0@1",),
        ("--push=chest:9,0,0@1", "--push=chest:0,9,0@2"),
    ]
    assert rows[2].cells["push"] == "chest:9,0,0@1; chest:0,9,0@2"


def test_null_leaves_an_option_or_a_parameter_out(tmp_path: Path) -> None:
    rows = read(tmp_path, "{run: {clip: [null, walk]}, set: {sim_node.rate: null}}").rows()

    assert [row.arguments for row in rows] == [(), ("--clip=walk",)]
    assert [row.cells for row in rows] == [{"clip": None}, {"clip": "walk"}]


def test_seeds_are_of_planner_and_sensors(tmp_path: Path) -> None:
    first, second = read(tmp_path, "seeds: 2").rows()

    assert (first.cells, second.cells) == ({"seed": 1}, {"seed": 2})
    assert second.arguments == (
        "--set=controller_node.plan.seed:=2",
        "--set=sim_node.sensor_seed:=2",
    )


def test_each_combination_has_the_same_random_values(tmp_path: Path) -> None:
    text = """
        run: {clip: [walk, kick], push: "chest:{force},0,0@1"}
        random: {count: 3, seed: 5, force: {uniform: [1, 9]}, sim_node.friction: {log: [0.1, 1]}}
        """
    rows = read(tmp_path, text).rows()

    assert len(rows) == 6
    values = [(row.cells["force"], row.cells["sim_node.friction"]) for row in rows]
    assert values[:3] == values[3:]
    assert len(set(values)) == 3
    force, friction = values[0]
    assert rows[0].arguments[1:] == (
        f"--push=chest:{force!r},0,0@1",
        f"--set=sim_node.friction:={friction!r}",
    )


def test_more_draws_and_other_names_leave_random_values_as_they_are(tmp_path: Path) -> None:
    few = read(tmp_path, "random: {count: 2, sim_node.friction: {uniform: [0, 1]}}").rows()
    more = read(
        tmp_path,
        "random: {count: 9, sim_node.gravity: {uniform: [0, 1]}, sim_node.friction: "
        "{uniform: [0, 1]}}",
    ).rows()

    name = "sim_node.friction"
    assert [row.cells[name] for row in few] == [row.cells[name] for row in more[:2]]


VALUES = st.recursive(
    st.booleans()
    | st.integers(-(2**60), 2**60)
    | st.floats(allow_nan=False)
    | st.text(st.characters(codec="utf-8", exclude_characters="{}"), max_size=20),
    lambda inner: st.lists(inner, max_size=3),
    max_leaves=4,
)


@given(st.lists(VALUES, min_size=1, max_size=3, unique_by=repr))
def test_parameters_are_set_to_the_values_that_the_file_has(
    tmp_path_factory: pytest.TempPathFactory, values: list[object]
) -> None:
    content = {"set": {"sim_node.x": values}}
    try:
        rows = read(tmp_path_factory.mktemp("s"), yaml.safe_dump(content)).rows()
    except ConfigurationError as error:  # 1 and True, 2 and 2.0 and '2' are no two of a kind
        assert "twice" in str(error) or "not valid YAML" in str(error)
        return

    texts = [text.removeprefix("--set=") for row in rows for text in row.arguments]
    found = [node_settings([text], NODES)["sim_node"]["x"] for text in texts]
    assert repr(found) == repr(values)


MISTAKES = {
    "runs: {}": "unknown key 'runs'; did you mean 'run'?",
    "run: 3": "run is 3; it must be a mapping",
    "[1]": "must hold a mapping",
    "run: {clipp: walk}": "unknown option of run 'run.clipp'; did you mean 'clip'?",
    "run: {view: true}": "unknown option of run 'run.view'",
    "run: {output: here}": "unknown option of run 'run.output'",
    "run: {clip: {a: 1}}": "run.clip is a dict; it must be a text, a number or a list of such",
    "run: {clip: [[walk]]}": "run.clip is a list; it must be a text, a number or a list of such",
    "run: {clip: true}": "run.clip is True; it must be",
    "run: {clip: []}": "run.clip is a list; it must be a value, or a list of at least one",
    "run: {push: [[1, {}]]}": "it must be a text, a number, a list of them or a list of such",
    "run: {clip: [walk, kick, walk]}": "run.clip has walk twice",
    "run: {cmd_vel: '1,0,0@0', cmd-vel: '1,0,0@0'}": "run.cmd-vel is given twice",
    "set: {friction: 1}": "set.friction is no parameter; write it as NODE.NAME",
    "set: {sim.friction: 1}": "unknown node 'set.sim'; there are: sim_node, controller_node",
    "set: {sim_node.friction: {a: 1}}": "set.sim_node.friction is a dict; it must be a value",
    "set: {sim_node.friction: []}": "at least one",
    "values: {force: 1}": "nothing uses the value 'force'",
    "run: {push: 'chest:{force},0,0@1'}": "of the place {force}: there is no value 'force'",
    "{run: {push: 'a:{forse},0,0@1'}, values: {force: 1}}": "did you mean 'force'?",
    "values: {clip: 1}": "values.clip is the name of another column",
    "values: {fell: 1}": "values.fell is the name of another column",
    "values: {1a: 1}": "values.1a must be a name of letters",
    "values: {force: [[1]]}": "values.force is a list; it must be a text, a number",
    "random: {count: 3}": "random.count is 3; it must be left out: nothing is random",
    "random: {sim_node.rate: {uniform: [0, 1]}}": "random.count is None; it must be a whole number",
    "random: {count: 0, sim_node.rate: {uniform: [0, 1]}}": "it must be a whole number from 1",
    "random: {count: 1, seed: x}": "random.seed is 'x'; it must be a whole number from 0",
    "random: {count: 1, sim_node.rate: 3}": "random.sim_node.rate is 3; it must be a mapping",
    "random: {count: 1, node.rate: {uniform: [0, 1]}}": "unknown node 'random.node'",
    "random: {count: 1, sim_node.rate: {normal: [0, 1], bounds: [90, 91]}}": "none lies within",
    "{set: {sim_node.a: 1}, random: {count: 1, sim_node.a: {uniform: [0, 1]}}}": "given twice",
    "{set: {sim_node.sensor_seed: 1}, seeds: 2}": "sim_node.sensor_seed is given twice, which",
    "seeds: 0": "seeds is 0; it must be their number, or a list of whole numbers",
    "seeds: [1, 1]": "seeds has 1 twice",
    "seeds: [-1]": "seeds is a list; it must be",
    "bags: some": "bags is 'some'; it must be 'none' or 'failures' or 'all'",
    "{random: {count: 999, sim_node.a: {uniform: [0, 1]}}, seeds: 5000}": "are 4,995,000 rows",
    "run: [": "not valid YAML",
}


@pytest.mark.parametrize("text", MISTAKES)
def test_each_mistake_is_a_line_that_names_the_file_and_what_is_right(
    tmp_path: Path, text: str
) -> None:
    with pytest.raises(ConfigurationError) as raised:
        read(tmp_path, text)

    line = str(raised.value)
    assert line.startswith(f"{tmp_path / 'sweep.yaml'}")
    assert MISTAKES[text] in line
    assert "\n" not in line


@pytest.mark.parametrize(("name", "error"), [("none.yaml", "No such file"), ("a.bvh", "capture")])
def test_a_file_that_is_none_is_a_line(tmp_path: Path, name: str, error: str) -> None:
    if name.endswith("bvh"):
        (tmp_path / name).write_text("HIERARCHY")

    with pytest.raises(ConfigurationError, match=error):
        read_sweep(tmp_path / name, row_options(), FIGURES)


def test_the_options_of_rows_are_those_that_describe_a_run() -> None:
    """A new option of `run` is to be weighed: is it of the run, or of the command?"""
    assert row_options() == {
        **dict.fromkeys(("character", "clip", "keyframes", "timeline", "reference"), False),
        **dict.fromkeys(("cmd-vel", "behaviour", "machine", "onnx", "collision", "planner"), False),
        **dict.fromkeys(("duration", "compression", "log-time"), False),
        **dict.fromkeys(("push", "throw", "sensor", "exclude"), True),
    }


def test_the_page_shows_the_example_that_is_shipped() -> None:
    example = (PROJECT / "examples/pushes.yaml").read_text("utf-8")
    page = (PROJECT / "docs/sweep.md").read_text("utf-8")

    _, _, content = example.partition("\n\n")
    assert f"```yaml\n{content.partition('run:')[1]}{content.partition('run:')[2]}```" in page
    assert len(read_sweep(PROJECT / "examples/pushes.yaml", row_options(), FIGURES).rows()) == 12
