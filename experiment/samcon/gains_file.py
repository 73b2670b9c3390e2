"""Files of window feedbacks: those that come with the presets, and the user's own."""

import json
from hashlib import sha256
from pathlib import Path

from controller_node.references.corrected_file import write_whole
from controller_node.window_gains import WindowGains, window_gains
from msgs_config.errors import ConfigurationError, LayoutError
from msgs_config.files import read_text
from msgs_config.joint_layout import ROOT, JointLayout

SHIPPED = Path(__file__).parent
SUFFIX = ".json"


def read_gains(name_or_path: str) -> WindowGains:
    """The window feedback of a file: the name of one that is shipped, or a path.

    Raises:
        ConfigurationError: there is none, or it holds something else.
    """
    path = Path(name_or_path)
    if path.suffix != SUFFIX:
        path = SHIPPED / f"{name_or_path}.gains{SUFFIX}"
    try:
        if not path.is_file():
            raise ConfigurationError(
                f"no such file; give a {SUFFIX} file, or one of {', '.join(_shipped())}"
            )
        return window_gains(json.loads(read_text(path, ConfigurationError)))
    except (ValueError, RecursionError) as error:
        raise ConfigurationError(f"{path}: not JSON") from error
    except ConfigurationError as error:
        raise ConfigurationError(f"window feedback {name_or_path}: {error}") from error


def write_gains(path: Path, gains: WindowGains) -> None:
    """Write a window feedback; the file is there at once.

    Raises:
        ClipError: it cannot be written.
        ConfigurationError: a gain is not finite, or beyond reason.
    """
    content = window_gains(gains.content()).content()  # what cannot be read is not written
    lines = ",\n".join(f"{json.dumps(name)}: {json.dumps(content[name])}" for name in content)
    write_whole(path, f"{{\n{lines}\n}}\n")


def check_joints(name: str, gains: WindowGains, layout: JointLayout) -> None:
    """Raise ConfigurationError if a feedback's degrees of freedom are not a character's to move."""
    try:
        moved = layout.indices(gains.dofs)
        if layout.has_floating_base and layout.mask((ROOT,))[moved].any():
            raise LayoutError(f"'{ROOT}' is moved; it has no motor")
    except LayoutError as error:
        raise ConfigurationError(f"window feedback {name}: {error}") from error


def check_cycle(windows: int, wanted: int) -> None:
    """Raise ConfigurationError if a feedback's windows a cycle are not as many as wanted."""
    if windows != wanted:
        raise ConfigurationError(
            f"the window feedback has {windows} windows a cycle; here a cycle has {wanted}: "
            "leave --window, or do without (--window-feedback none)"
        )


def digest(gains: WindowGains) -> str:
    """A number of a feedback's content, to tell whether it is the same."""
    return sha256(json.dumps(gains.content()).encode()).hexdigest()


def _shipped() -> list[str]:
    ending = f".gains{SUFFIX}"
    return sorted(file.name.removesuffix(ending) for file in SHIPPED.glob(f"*{ending}"))
