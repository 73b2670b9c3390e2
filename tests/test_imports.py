"""The layers of the design, read from the import statements; and what packaging says twice."""

import ast
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

PROJECT = Path(__file__).parents[1]
MAY_IMPORT = {  # of the project's own packages
    "msgs_config": set(),
    "sim_node": {"msgs_config"},
    "controller_node": {"msgs_config"},
    "experiment": {"msgs_config", "sim_node", "controller_node"},
}
ROS_NAMES = re.compile(
    r"rclpy|rpyutils|rosidl_\w+|ament_\w+|builtin_interfaces|rcl_interfaces|\w+_(msgs|srvs)"
)
EDGE = {  # the files that speak ROS, beside all of experiment/
    "msgs_config/diagnostics.py",
    "msgs_config/messages.py",
    "msgs_config/node_parameters.py",
    "msgs_config/polling.py",
    "msgs_config/process.py",
    "msgs_config/throw_messages.py",
    "msgs_config/topics.py",
    "msgs_config/warnings.py",
    "msgs_config/wrench_messages.py",
    "sim_node/display.py",
    "sim_node/inbox.py",
    "sim_node/initial_state_topic.py",
    "sim_node/markers.py",
    "sim_node/node.py",
    "sim_node/outputs.py",
    "sim_node/port.py",
    "sim_node/rivals.py",
    "sim_node/services.py",
    "sim_node/waiting.py",
    "sim_node/world_port.py",
    "controller_node/contact_inbox.py",
    "controller_node/node.py",
    "controller_node/outputs.py",
    "controller_node/plan_message.py",
    "controller_node/simulators.py",
    "controller_node/stamped_inbox.py",
    "controller_node/strengths_topic.py",
    "controller_node/trajectories.py",
}
FINDS_PACKAGES = "msgs_config/files.py"  # ament_index_python, to resolve package://
ENGINES = {
    "pybullet": {"msgs_config/bullet.py"},
    "mujoco": {
        "msgs_config/dynamics.py",
        "controller_node/planner/compiled/engine.py",
        "controller_node/planner/contact_model.py",
    },
}
MAY_USE_BULLET = {
    "msgs_config/character_loading.py",
    "sim_node/balls.py",
    "sim_node/body.py",
    "sim_node/contacts.py",
    "sim_node/links.py",
    "sim_node/stage.py",
    "sim_node/world.py",
}
KNOW_NO_ROS = [
    "msgs_config.arrays",
    "msgs_config.character",
    "msgs_config.character_loading",
    "msgs_config.joint_layout",
    "msgs_config.parameters",
    "msgs_config.probe",
    "msgs_config.rotations",
    "msgs_config.session",
    "msgs_config.throw",
    "msgs_config.tick_clock",
    "msgs_config.versions",
    "sim_node.actor",
    "sim_node.aim",
    "sim_node.back_pressure",
    "sim_node.camera",
    "msgs_config.geometry.frames",
    "sim_node.canvas",
    "sim_node.compositing",
    "sim_node.ground",
    "sim_node.initial_state",
    "sim_node.lockstep",
    "sim_node.pace",
    "sim_node.parameters",
    "sim_node.passive",
    "sim_node.patience",
    "sim_node.probe",
    "sim_node.puppet",
    "sim_node.pushes",
    "sim_node.realtime",
    "sim_node.run_control",
    "sim_node.simulation",
    "sim_node.throwing",
    "controller_node.actuation",
    "controller_node.agreement",
    "controller_node.balance",
    "controller_node.behaviours.give_way",
    "controller_node.behaviours.hits",
    "controller_node.behaviours.library",
    "controller_node.behaviours.make",
    "controller_node.behaviours.reaction",
    "controller_node.control_laws",
    "controller_node.controller",
    "controller_node.effort_series",
    "controller_node.laws",
    "controller_node.parameters",
    "controller_node.references.reconstructed_file",
    "controller_node.references.curve",
    "controller_node.references.inertialised",
    "controller_node.references.keyframe_file",
    "controller_node.references.keyframes",
    "controller_node.references.limits",
    "controller_node.references.moved",
    "controller_node.references.signals",
    "controller_node.references.trajectory",
    "controller_node.strength",
    "experiment.bags.claim",
    "experiment.bags.limits",
    "experiment.bags.metadata",
    "experiment.bags.salvage",
    "experiment.bags.storage",
    "experiment.equation",
    "experiment.recorder.loss_count",
    "experiment.render.camera_path",
    "experiment.render.captions",
    "experiment.render.video",
    "experiment.report.decimation",
    "experiment.report.page",
    "experiment.report.timing",
    "experiment.studies.euler",
    "experiment.studies.tracking",
    "experiment.studies.second_order",
]
KNOW_NO_ENGINE = [
    "msgs_config.joint_layout",
    "msgs_config.messages",
    "msgs_config.parameters",
    "msgs_config.probe",
    "msgs_config.rotations",
    "msgs_config.throw",
    "msgs_config.tick_clock",
    "sim_node.back_pressure",
    "sim_node.lockstep",
    "sim_node.compositing",
    "sim_node.ground",
    "sim_node.looks",
    "sim_node.patience",
    "sim_node.surfaces",
    "sim_node.throwing",
    "sim_node.view",
    "controller_node.actuation",
    "controller_node.behaviours.hits",
    "controller_node.behaviours.posture",
    "controller_node.control_laws",
    "controller_node.effort_series",
    "controller_node.references.reconstructed_file",
    "controller_node.references.curve",
    "controller_node.references.inertialised",
    "controller_node.references.keyframe_file",
    "controller_node.references.keyframes",
    "controller_node.references.limits",
    "controller_node.references.moved",
    "controller_node.references.signals",
    "controller_node.references.trajectory",
    "experiment.bags.claim",
    "experiment.bags.limits",
    "experiment.bags.metadata",
    "experiment.bags.salvage",
    "experiment.bags.storage",
    "experiment.recorder.loss_count",
    "experiment.render.camera_path",
    "experiment.report.decimation",
    "experiment.report.page",
    "experiment.report.timing",
    "experiment.studies.tracking",
    "experiment.studies.second_order",
    "experiment.studies.euler",
]

SOURCES = sorted(
    path.relative_to(PROJECT).as_posix()
    for package in MAY_IMPORT
    for path in (PROJECT / package).rglob("*.py")
)


@cache
def imports_of(source: str) -> frozenset[str]:
    """Every module that a file imports, anywhere in it; `from a import b` counts as `a.b` too."""
    return frozenset(_imports(ast.parse((PROJECT / source).read_text(encoding="utf-8"))))


def _imports(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0 and node.module, "relative imports hide the layer"
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def roots_of(source: str) -> set[str]:
    """The packages that a file imports from."""
    return {module.split(".")[0] for module in imports_of(source)}


def file_of(module: str) -> str | None:
    """The file of one of the project's own modules; None for anything else."""
    path = module.replace(".", "/")
    return next((file for file in (f"{path}.py", f"{path}/__init__.py") if file in SOURCES), None)


def reached_from(module: str) -> set[str]:
    """The project's files that come with a module, itself included."""
    first = file_of(module)
    assert first is not None, f"{module} does not exist"
    reached, pending = set[str](), [first]
    while pending:
        source = pending.pop()
        if source not in reached:
            reached.add(source)
            pending += [file for name in imports_of(source) if (file := file_of(name))]
    return reached


def ros_packages(source: str) -> set[str]:
    return {root for root in roots_of(source) if ROS_NAMES.fullmatch(root)}


def assert_nothing_wrong(
    candidates: Iterable[str], wrong_in: Callable[[str], Iterable[str]]
) -> None:
    """No file or module has anything wrong in it; all that have are named, with what it is."""
    found = [f"{each}: {', '.join(sorted(w))}" for each in candidates if (w := wrong_in(each))]
    assert not found, "\n".join(["", *found])


def test_there_are_sources_to_read() -> None:
    assert {source.split("/")[0] for source in SOURCES} == set(MAY_IMPORT)
    assert "pybullet" in roots_of("msgs_config/bullet.py")
    assert "rclpy" in roots_of("msgs_config/process.py")  # imported inside a function


# The layers


def test_imports_run_one_way_between_the_packages() -> None:
    def strangers(source: str) -> set[str]:
        package = source.split("/")[0]
        return roots_of(source) & (set(MAY_IMPORT) - {package} - MAY_IMPORT[package])

    assert_nothing_wrong(SOURCES, strangers)


def test_nothing_that_runs_imports_the_tests() -> None:
    not_for_users = {"tests", "pytest", "hypothesis", "benchmarks", "examples"}

    assert_nothing_wrong(SOURCES, lambda source: roots_of(source) & not_for_users)


def test_each_engine_is_imported_by_the_one_file_named_for_it() -> None:
    importers = {
        engine: {source for source in SOURCES if engine in roots_of(source)} for engine in ENGINES
    }

    assert importers == ENGINES


def test_the_simulators_engine_is_used_by_the_files_around_it_alone() -> None:
    users = {source for source in SOURCES if "msgs_config.bullet.pybullet" in imports_of(source)}

    assert users == MAY_USE_BULLET
    importers = {source for source in SOURCES if "msgs_config.bullet" in imports_of(source)}
    assert importers == MAY_USE_BULLET


def test_ros_is_spoken_at_the_edge_alone() -> None:
    speakers = {source for source in SOURCES if ros_packages(source) - {"ament_index_python"}}
    packages_found_by = {source for source in SOURCES if "ament_index_python" in roots_of(source)}

    assert {source for source in speakers if not source.startswith("experiment/")} <= EDGE
    assert {source for source in packages_found_by if not source.startswith("experiment/")} <= {
        FINDS_PACKAGES
    }


def test_every_file_at_the_edge_speaks_ros() -> None:
    not_at_the_edge_any_more = {edge for edge in EDGE if not ros_packages(edge)}

    assert not_at_the_edge_any_more == set()


def test_what_knows_no_ros_does_not_reach_it_by_way_of_another_file() -> None:
    assert_nothing_wrong(KNOW_NO_ROS, lambda module: reached_from(module) & EDGE)


def test_what_knows_no_engine_does_not_reach_it_by_way_of_another_file() -> None:
    engines = set.union(*ENGINES.values())

    assert_nothing_wrong(KNOW_NO_ENGINE, lambda module: reached_from(module) & engines)


def test_the_simulator_reaches_no_model_and_the_controller_no_simulator() -> None:
    simulator, controller = reached_from("sim_node.node"), reached_from("controller_node.node")

    assert not any(source.startswith("controller_node/") for source in simulator)
    assert not any(source.startswith("sim_node/") for source in controller)


def test_a_process_can_limit_its_threads_before_numpy_loads() -> None:
    mains = ["sim_node/main.py", "controller_node/main.py"]

    assert_nothing_wrong(mains, lambda main: _roots_at_import(main) & {"numpy", "rclpy"})


def _roots_at_import(source: str) -> set[str]:
    """The packages that a file loads when it is imported itself, functions left aside."""
    roots, pending, seen = set[str](), [source], set[str]()
    while pending:
        file = pending.pop()
        if file in seen:
            continue
        seen.add(file)
        tree = ast.parse((PROJECT / file).read_text(encoding="utf-8"))
        top = ast.Module([node for node in tree.body if not _is_definition(node)], [])
        for name in _imports(top):
            roots.add(name.split(".")[0])
            own = file_of(name)
            pending += [own] if own else []
    return roots


def _is_definition(node: ast.stmt) -> bool:
    return isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef))


# What packaging says twice


def package_xml() -> ElementTree.Element:
    return ElementTree.fromstring((PROJECT / "package.xml").read_bytes())


def setup_arguments() -> dict[str, ast.expr]:
    tree = ast.parse((PROJECT / "setup.py").read_text(encoding="utf-8"))
    calls = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "setup"
    ]
    (call,) = calls
    return {keyword.arg: keyword.value for keyword in call.keywords if keyword.arg}


def test_both_package_files_have_one_version_and_one_licence() -> None:
    arguments = setup_arguments()

    assert package_xml().findtext("version") == ast.literal_eval(arguments["version"])
    assert package_xml().findtext("license") == ast.literal_eval(arguments["license"])
    assert package_xml().findtext("maintainer") == ast.literal_eval(arguments["maintainer"])


def test_every_ros_package_that_is_imported_is_a_dependency() -> None:
    declared = {element.text for element in package_xml().iter("exec_depend")}
    imported = set.union(*(ros_packages(source) for source in SOURCES))

    assert imported <= declared


def test_every_python_package_that_is_imported_is_required() -> None:
    distributions = {"PyYAML": "yaml", "mujoco-core": "mujoco"}
    arguments = setup_arguments()
    requirements = ast.literal_eval(arguments["install_requires"])
    extras = ast.literal_eval(arguments["extras_require"])
    requirements += extras["video"] + extras["plan"]
    names = {re.split(r"[<>=[]", requirement)[0] for requirement in requirements}
    required = {distributions.get(name, name) for name in names}
    imported = {
        root
        for source in SOURCES
        for root in roots_of(source) - ros_packages(source)
        if root not in sys.stdlib_module_names and root not in MAY_IMPORT
    }

    assert imported <= required


def test_every_folder_with_sources_is_a_package() -> None:
    folders = {(PROJECT / source).parent for source in SOURCES}

    assert {folder for folder in folders if not (folder / "__init__.py").exists()} == set()
