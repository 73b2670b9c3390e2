"""Packages that not every user has: what they are for, and how one gets them."""

from importlib.util import find_spec

from msgs_config.errors import ActuatedCharactersError, ConfigurationError

PACKAGES = {
    "gymnasium": ("gymnasium",),
    "meshes": ("trimesh",),
    "onnx": ("onnx", "onnxruntime"),
    "sweep": ("distributed", "cryptography"),
    "video": ("av",),
    "view": ("viser", "websockets"),
    "wheels": ("rclpy",),
    "xacro": ("xacro",),
}
"""Python packages of the extras of `setup.py`, by the extras' names."""


def hint(extra: str) -> str:
    """How to install an extra."""
    elsewhere = ", or source the setup file of a ROS 2 Jazzy" if extra == "wheels" else ""
    return (
        f"pip install 'actuated_characters[{extra}]', or in a clone "
        f".venv/bin/pip install -e '.[{extra}]'{elsewhere}"
    )


def is_installed(extra: str) -> bool:
    """Whether all packages of an extra are there."""
    return all(find_spec(package) is not None for package in PACKAGES[extra])


def require_extra(
    extra: str, what: str, error: type[ActuatedCharactersError] = ConfigurationError
) -> None:
    """Check that the packages of an extra are installed, before anything begins.

    Args:
        extra: A key of `PACKAGES`.
        what: What needs it: the subject of the error's sentence.
        error: The class of the error.

    Raises:
        error: one is missing; says how to get it.
    """
    for package in PACKAGES[extra]:
        if find_spec(package) is None:
            raise error(
                f"{what} needs the extra '{extra}' ({package} is not installed): {hint(extra)}"
            )
