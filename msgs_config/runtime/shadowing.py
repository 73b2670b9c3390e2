"""Finds out whether modules of this package are hidden by others of the same names."""

from importlib.util import find_spec
from pathlib import Path

_PACKAGES = ("sim_node", "controller_node", "actuated_characters")
_HOME = Path(__file__).parents[2]  # where msgs_config and the others lie side by side


def shadowed_packages() -> list[str]:
    """A sentence for each package of ours in whose place Python finds another one.

    Names such as `sim_node` are not ours alone; whichever comes first on `sys.path` is imported.
    """
    sentences = []
    for name in _PACKAGES:
        spec = find_spec(name)
        if spec is None or spec.origin is None:
            continue
        found = Path(spec.origin).resolve().parent
        if found != (_HOME / name).resolve():
            sentences.append(
                f"Python finds another '{name}' first, {found}; ours is {_HOME / name}: take that "
                "package's folder out of PYTHONPATH, or install one of the two elsewhere"
            )
    return sentences
