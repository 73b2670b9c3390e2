"""Golden runs keep their states whatever kernels numpy has: poisoned ones, or other ones."""

from pathlib import Path

import numpy as np
import pytest

from sim_node.physics.engine import INSTALLED_ENGINES
from tests.support import golden

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not golden.HOLD_HERE, reason=golden.WHY_NOT),
]

NIGHTLY = pytest.mark.nightly
TABLE = golden.golden()["runs"]
OF_EVERY_KIND = ["walk_480_delay", "reactive_hit", "panda_sine", "walk_reconstructed"]
SENSITIVE = "walk_explicit_pd_2khz"  # blows up the last bits of a rotation
FEATURES: list[str] = np._core._multiarray_umath.__cpu_dispatch__

# Every function whose last bits are numpy's choice gives the next double but one. What is compiled
# is there before: it calls none of them, but numba looks for numpy's own as it begins.
POISON = """
import math
import numpy as np
import msgs_config.compiled.dynamics, msgs_config.compiled.message_form

ELEMENTARY = (
    "sin cos tan sinh cosh tanh arcsin arccos arctan arctan2 exp exp2 expm1 log log2 log10 log1p "
    "power float_power hypot cbrt"
).split()
PRODUCTS = "dot vdot inner matmul tensordot einsum trace convolve interp".split()

def poisoned(function):
    def off(*arguments, **options):
        result = function(*arguments, **options)
        if getattr(result, "dtype", None) == float:
            result = result * (1.0 + 2.0**-51)
        return result
    return off

for owner, names in (
    (np, ELEMENTARY + PRODUCTS),
    (np.linalg, [name for name in np.linalg.__all__ if name.islower()]),
):
    for name in names:
        setattr(owner, name, poisoned(getattr(owner, name)))
assert np.sin(np.float64(1.0)) != math.sin(1.0)
assert np.linalg.norm(np.ones(1)) != 1.0
"""


@pytest.mark.parametrize(
    ("name", "engine"),
    [
        pytest.param(name, engine, marks=[] if at % len(INSTALLED_ENGINES) == turn else NIGHTLY)
        for at, name in enumerate(OF_EVERY_KIND)
        for turn, engine in enumerate(INSTALLED_ENGINES)
    ],
)
def test_no_kernel_that_is_numpys_choice_takes_part(name: str, engine: str, tmp_path: Path) -> None:
    arguments = golden.arguments_of(name, engine)

    summary = golden.summary_apart(arguments, tmp_path / "run", before=POISON)

    assert summary["state_hash"] == TABLE[name][engine]["state_hash"]


@pytest.mark.parametrize("engine", INSTALLED_ENGINES)
@pytest.mark.parametrize(
    "environment",
    [
        {"NPY_DISABLE_CPU_FEATURES": " ".join(FEATURES)},
        *(
            pytest.param({"NPY_DISABLE_CPU_FEATURES": " ".join(some)}, marks=NIGHTLY)
            for some in (FEATURES[at:] for at in range(1, len(FEATURES)))
        ),
        *(
            pytest.param({"OPENBLAS_CORETYPE": core}, marks=NIGHTLY)
            for core in ("Nehalem", "Haswell")
        ),
    ],
    ids=lambda environment: "-".join(environment.values()).replace(" ", "-"),
)
def test_the_processors_kernels_do_not_matter(
    environment: dict[str, str], engine: str, tmp_path: Path
) -> None:
    arguments = golden.arguments_of(SENSITIVE, engine)

    summary = golden.summary_apart(arguments, tmp_path / "run", environment=environment)

    assert summary["state_hash"] == TABLE[SENSITIVE][engine]["state_hash"]
