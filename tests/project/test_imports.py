"""What import-linter does not say of imports, and what packaging says twice."""

import ast
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

PROJECT = Path(__file__).parents[2]
PACKAGES = (
    "msgs_config",
    "sim_node",
    "controller_node",
    "character_motion",
    "actuated_characters",
    "lecture",
)
ROS_NAMES = re.compile(
    r"rclpy|rpyutils|launch|launch_ros|rosidl_\w+|ament_\w+|builtin_interfaces|rcl_interfaces|\w+_(msgs|srvs)"
)
COMPOSED = "actuated_characters/composed"
ENGINES = {  # who imports them; how far they are known beyond that is in pyproject.toml
    "pybullet": {"sim_node/physics/bullet/client.py"},
    "mujoco": {
        "msgs_config/character/dynamics.py",
        *(f"msgs_config/character/mjcf/{name}.py" for name in ("actuators", "compiling")),
        *(f"msgs_config/character/mjcf/{name}.py" for name in ("followers", "left_out", "places")),
        *(f"msgs_config/character/mjcf/{name}.py" for name in ("reading", "robot", "sensors")),
        *(f"msgs_config/character/mjcf/{name}.py" for name in ("shapes", "urdf")),
        "msgs_config/character/mujoco_model.py",
        "msgs_config/character/mujoco_world.py",
        "msgs_config/terrain/heights.py",
        "msgs_config/terrain/surfaces.py",
        "msgs_config/compiled/data_layout.py",
        "msgs_config/compiled/mujoco_functions.py",
        *(f"sim_node/physics/mujoco/{name}.py" for name in ("balls", "body", "contacts")),
        *(f"sim_node/physics/mujoco/{name}.py" for name in ("model", "part", "world")),
        *(f"sim_node/physics/mujoco/{name}.py" for name in ("batch", "compiled_step")),
        "controller_node/planner/contact_model.py",
        "lecture/tick/stages.py",  # calls the parts of a step one by one
    },
}

SOURCES = sorted(
    path.relative_to(PROJECT).as_posix()
    for package in PACKAGES
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


def ros_packages(source: str) -> set[str]:
    return {root for root in roots_of(source) if ROS_NAMES.fullmatch(root)}


def assert_nothing_wrong(
    candidates: Iterable[str], wrong_in: Callable[[str], Iterable[str]]
) -> None:
    """No file or module has anything wrong in it; all that have are named, with what it is."""
    found = [f"{each}: {', '.join(sorted(w))}" for each in candidates if (w := wrong_in(each))]
    assert not found, "\n".join(["", *found])


def test_there_are_sources_to_read() -> None:
    assert {source.split("/")[0] for source in SOURCES} == set(PACKAGES)
    assert "pybullet" in roots_of("sim_node/physics/bullet/client.py")
    assert "rclpy" in roots_of("msgs_config/runtime/process.py")  # imported inside a function


# The layers


def test_nothing_that_runs_imports_the_tests() -> None:
    not_for_users = {"tests", "pytest", "hypothesis", "benchmarks", "examples"}

    assert_nothing_wrong(SOURCES, lambda source: roots_of(source) & not_for_users)


def test_each_engine_is_imported_by_the_files_named_for_it() -> None:
    importers = {
        engine: {source for source in SOURCES if engine in roots_of(source)} for engine in ENGINES
    }

    assert importers == ENGINES


def test_a_process_can_limit_its_threads_before_numpy_loads() -> None:
    mains = [f"{folder}/main.py" for folder in ("sim_node", "controller_node", COMPOSED)]

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


def test_every_ros_package_that_is_imported_is_a_dependency() -> None:
    declared = {element.text for element in package_xml().iter("exec_depend")}
    imported = set.union(*(ros_packages(source) for source in SOURCES))

    assert imported <= declared


def test_every_python_package_that_is_imported_is_required() -> None:
    distributions = {
        "PyYAML": "yaml",
        "mujoco-core": "mujoco",
        "pillow": "PIL",
        "pycollada": "collada",
    }
    arguments = setup_arguments()
    requirements = ast.literal_eval(arguments["install_requires"])
    extras = ast.literal_eval(arguments["extras_require"])
    optional = ("video", "gymnasium", "onnx", "completion", "meshes", "sweep", "view", "xacro")
    requirements += [each for extra in optional for each in extras[extra]]
    names = {re.split(r"[<>=[]", requirement)[0] for requirement in requirements}
    required = {distributions.get(name, name) for name in names}
    imported = {
        root
        for source in SOURCES
        for root in roots_of(source) - ros_packages(source)
        if root not in sys.stdlib_module_names and root not in PACKAGES
    }

    assert imported <= required


def test_every_folder_with_sources_is_a_package() -> None:
    folders = {(PROJECT / source).parent for source in SOURCES}

    assert {folder for folder in folders if not (folder / "__init__.py").exists()} == set()
