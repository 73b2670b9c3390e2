"""`python -m msgs_config.fetch_robots`: the package `pybullet_data` where there is no PyBullet.

Its robots and clips, which are in PyBullet's wheel for Python 3.11, are the same for any Python.
"""

import subprocess
import sys
import sysconfig
import tempfile
import zipfile
from importlib.util import find_spec
from pathlib import Path

_PACKAGE = "pybullet_data"
_WHEEL = "pybullet==3.2.7"
_BUILT_FOR = (
    *("--implementation", "cp", "--python-version", "3.11"),
    *("--platform", "manylinux2014_x86_64", "--only-binary", ":all:"),
)


def main() -> int:
    """Download the wheel unless the package is there, and unpack it; pip's exit code."""
    if find_spec(_PACKAGE) is not None:
        return 0
    print(f"fetching the package {_PACKAGE} (140 MB) ...", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        pip = (sys.executable, "-m", "pip", "download", "-qq", "--no-deps", "--dest", folder)
        done = subprocess.run([*pip, *_BUILT_FOR, _WHEEL], check=False)
        if done.returncode == 0:
            (wheel,) = Path(folder).glob("*.whl")
            try:
                _unpack(wheel, Path(sysconfig.get_path("purelib")))
            except OSError as error:
                print(f"error: {error}; a virtual environment can be written to", file=sys.stderr)
                return 1
    return done.returncode


def _unpack(wheel: Path, packages: Path) -> None:
    """Put the package beside the others: all of it or nothing."""
    with tempfile.TemporaryDirectory(dir=packages) as folder, zipfile.ZipFile(wheel) as archive:
        names = [name for name in archive.namelist() if name.startswith(f"{_PACKAGE}/")]
        archive.extractall(folder, names)
        (Path(folder) / _PACKAGE).rename(packages / _PACKAGE)


if __name__ == "__main__":
    sys.exit(main())
