"""Versions on which the last bits of a run depend: this package, engines, Python, C library."""

import platform
from collections.abc import Mapping
from functools import cache
from importlib import metadata

_PACKAGES = ("actuated_characters", "pybullet", "mujoco-core", "numpy", "ros-jazzy-rclpy")
_ENGINES = ("actuated_characters", "mujoco-core", "pybullet")
_UNKNOWN_VERSION = "unknown"


def installed_versions() -> dict[str, str]:
    """The versions in this process, by name; `unknown` where there is none."""
    versions = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:  # a ROS install has some from elsewhere
            versions[package] = _UNKNOWN_VERSION
    versions["libc"] = " ".join(filter(None, platform.libc_ver())) or _UNKNOWN_VERSION
    return versions


@cache
def engine_versions() -> Mapping[str, str]:
    """Those that the states of a run in lockstep depend on, in this process."""
    versions = installed_versions()
    return {name: versions[name] for name in _ENGINES}


def read_versions(content: object) -> dict[str, str]:
    """The versions in a `~/configuration`; empty if there are none."""
    if not isinstance(content, dict):
        return {}
    return {str(name): str(version) for name, version in content.items()}


def describe_changes(recorded: Mapping[str, str], present: Mapping[str, str]) -> str:
    """A part of a sentence that names each version that is another one now; empty if none is.

    Versions that one side does not know are not compared.
    """
    changes = [
        f"{name} {before} (now {present[name]})"
        for name, before in recorded.items()
        if _UNKNOWN_VERSION not in (before, present.get(name, _UNKNOWN_VERSION))
        and before != present[name]
    ]
    return f"recorded with {', '.join(changes)}" if changes else ""
