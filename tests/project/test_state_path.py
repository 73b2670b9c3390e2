"""Nothing between a message and the next state has last bits of the processor's choosing.

Read from the code: every file that the two nodes, or a run in one process, import. numpy picks the
kernels of its elementary functions and of its linear algebra by the processor, and the order of the
additions of a reduction; `math.hypot` and Python's sum of floats differ between Pythons.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[2]
ROOMS = ("msgs_config", "sim_node", "controller_node", "actuated_characters")
ENTRANCES = [  # what works out states and efforts, and what a run of `--in-process` begins with
    "sim_node/node.py",
    "controller_node/node.py",
    "actuated_characters/runs/in_process.py",
    "actuated_characters/runs/plan.py",
    "actuated_characters/runs/planned/wrenches.py",
    "actuated_characters/runs/planned/throws.py",
]
HOME = {
    "msgs_config/geometry/elementary.py",
    "msgs_config/geometry/fixed_order.py",
}
NO_STATES = {  # figures of runs and of wall time, which nothing is simulated from
    "actuated_characters/metrics/run_metrics.py",
    "msgs_config/runtime/durations.py",
    "sim_node/timing/rate_limiter.py",
}
ELEMENTARY = re.compile(
    "sinc?|cos|tan|sinh|cosh|tanh|arc(sin|cos|tan|tan2|sinh|cosh|tanh)|asinh?|acosh?|atanh?|atan2|"
    "pow|power|float_power|exp|exp2|expm1|log|log2|log10|log1p|logaddexp2?|hypot|cbrt|angle|unwrap|i0"
)
REDUCTIONS = re.compile(
    "(nan)?(sum|mean|median|std|var|prod)|average|trace|dot|vdot|inner|matmul|matvec|vecmat|vecdot|"
    "tensordot|einsum|convolve|correlate|interp|trapezoid|poly\\w+|cov|corrcoef|cross|linalg|fft|gradient"
)
OF_ORDER_ALONE = {"minimum", "maximum", "fmin", "fmax", "logical_or", "logical_and"}
OF_ARRAYS = {"sum", "mean", "std", "var", "prod", "dot", "trace"}  # as methods
OF_MATH = {"hypot", "dist", "sumprod"}  # not the C library's
REMEDY = "msgs_config/geometry has it: elementary, fixed_order; of booleans, np.count_nonzero"


def imported(file: str) -> Iterator[str]:
    """The project's own files that a file imports."""
    for node in ast.walk(ast.parse((PROJECT / file).read_text("utf-8"))):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        for name in names:
            path = Path(*name.split("."))
            if path.parts[0] in ROOMS:
                for candidate in (path.with_suffix(".py"), path / "__init__.py"):
                    if (PROJECT / candidate).is_file():
                        yield candidate.as_posix()


def state_path() -> list[str]:
    """Every file that is imported on the way from a message to the next state."""
    found, unread = set[str](), list(ENTRANCES)
    while unread:
        file = unread.pop()
        if file not in found:
            found.add(file)
            unread += imported(file)
    return sorted(found - HOME - NO_STATES)


def offences(source: str) -> list[str]:
    """What a source must not do on the way, each with its line."""
    tree = ast.parse(source)
    judges = (_of_attributes, _of_operators, _of_builtins, _of_imports)
    return [
        f"line {node.lineno}: {offence}"
        for node in ast.walk(tree)
        if isinstance(node, ast.expr | ast.stmt)
        for judge in judges
        if (offence := judge(node))
    ]


def _of_attributes(node: ast.AST) -> str | None:
    if not isinstance(node, ast.Attribute):
        return None
    name, owner = node.attr, ast.unparse(node.value)
    if owner == "np" and (ELEMENTARY.fullmatch(name) or REDUCTIONS.fullmatch(name)):
        return f"np.{name}"
    if owner == "math" and name in OF_MATH:
        return f"math.{name}"
    ufunc = re.fullmatch(r"np\.(\w+)", owner)
    if ufunc and name in ("reduce", "reduceat", "at") and ufunc[1] not in OF_ORDER_ALONE:
        return f"{owner}.{name}"
    if name in OF_ARRAYS and not ufunc and owner not in ("math", "fixed_order", "statistics"):
        return f".{name}"
    return None


def _of_operators(node: ast.AST) -> str | None:
    if not isinstance(node, ast.BinOp | ast.AugAssign):
        return None
    if isinstance(node.op, ast.MatMult):
        return "@"
    base = node.left if isinstance(node, ast.BinOp) else node.target
    if isinstance(node.op, ast.Pow) and not re.fullmatch(r"-?[\d.]+", ast.unparse(base)):
        return "** of what is no constant"
    return None


def _of_builtins(node: ast.AST) -> str | None:
    """Python's sum of what may be floats."""
    if isinstance(node, ast.Call) and ast.unparse(node.func) == "sum":
        element = getattr(node.args[0], "elt", None)
        text = "" if element is None else ast.unparse(element)
        if not re.fullmatch(r"(len|int)\(.*\)|\d+( if .* else \d+)?|widths\.get\(.*, 1\)", text):
            return "sum of what may be floats"
    return None


def _of_imports(node: ast.AST) -> str | None:
    """Names that are imported out of numpy or math, where no other rule here would know them."""
    if isinstance(node, ast.Import):
        for alias in node.names:
            if alias.name.split(".")[0] == "numpy" and (alias.name, alias.asname) != (
                "numpy",
                "np",
            ):
                return f"import {alias.name}; only as np"
    if isinstance(node, ast.ImportFrom):
        names = {alias.name for alias in node.names}
        if (node.module or "").split(".")[0] == "numpy" and node.module != "numpy.typing":
            return f"from {node.module} import"
        if node.module == "math" and names & OF_MATH:
            return f"from math import {', '.join(names & OF_MATH)}"
    return None


def test_the_state_path_has_both_sides() -> None:
    path = set(state_path())

    assert {
        "controller_node/balance.py",
        "controller_node/node.py",
        "controller_node/behaviours/motion_library.py",
        "controller_node/references/clip.py",
        "controller_node/references/offsets.py",
        "msgs_config/character/dynamics.py",
        "msgs_config/geometry/rotations.py",
        "sim_node/physics/balls/sphere_sweep.py",
        "sim_node/timing/lockstep.py",
        "sim_node/physics/bullet/body.py",
        "sim_node/physics/passive_forces.py",
    } <= path
    assert not path & {
        "actuated_characters/render/engine/renderer.py",
        "actuated_characters/report/charts.py",
    }


@pytest.mark.slow
def test_nothing_in_the_state_path_has_last_bits_of_the_processors_choosing() -> None:
    found = [
        f"{file}, {offence}"
        for file in state_path()
        for offence in offences((PROJECT / file).read_text("utf-8"))
    ]

    assert not found, f"{REMEDY}\n" + "\n".join(found)


@pytest.mark.parametrize(
    "line",
    [
        "y = np.sin(x)",
        "y = a @ b",
        "a @= b",
        "y = np.linalg.solve(a, b)",
        "from numpy import sin",
        "from numpy.linalg import norm",
        "import numpy.linalg as la",
        "y = x.sum(axis=0)",
        "y = np.add.reduce(x)",
        "y = np.einsum('i,i', a, b)",
        "y = x ** 2",
        "y = x ** 0.5",
        "x **= 3",
        "y = sum(x)",
        "y = sum(a * b for a, b in pairs)",
        "y = math.hypot(a, b)",
        "from math import hypot",
        "f = partial(np.dot, a)",
    ],
)
def test_whoever_adds_one_is_told(line: str) -> None:
    assert offences(line)


@pytest.mark.parametrize(
    "line",
    [
        "y = math.sin(x)",
        "y = elementary.sin(x)",
        "y = fixed_order.dot(a, b)",
        "y = np.sqrt(x) + np.floor(x)",
        "y = np.maximum.reduceat(x, starts)",
        "y = 10**9",
        "y = (-1.0) ** k",
        "y = math.fsum(x)",
        "y = sum(len(x) for x in rows)",
        "y = np.cumsum(x)",
    ],
)
def test_what_has_one_result_is_allowed(line: str) -> None:
    assert not offences(line)
