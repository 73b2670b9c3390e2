"""Expands one xacro file in a process to itself: a xacro holds expressions, which are evaluated.

Its arguments are the file's path and `name:=value` for each argument of the file; the URDF goes to
standard output, and what is wrong to standard error, in one line.
"""

import sys
from pathlib import Path
from xml.etree import ElementTree

from ament_index_python import packages

from msgs_config import files
from msgs_config.errors import CharacterError

_FOLDERS_ABOVE = 6  # how many folders above a file are looked through for a package


def find_package(name: str, near: Path) -> str:
    """The folder of a ROS or Python package: installed, or in the workspace that a file lies in.

    There a package is a folder of its name, or one whose `package.xml` gives it this name.

    Raises:
        CharacterError: it is nowhere.
    """
    try:
        return str(files.resolve(f"package://{name}", near, CharacterError))
    except CharacterError:
        for above in list(near.parents)[:_FOLDERS_ABOVE]:
            for folder in (above, *sorted(each.parent for each in above.glob("*/package.xml"))):
                if name in (folder.name, _package_name(folder)):
                    return str(folder)
            if (above / name).is_dir():
                return str(above / name)
        raise


def _package_name(folder: Path) -> str | None:
    try:
        return ElementTree.parse(folder / "package.xml").findtext("name", "").strip()
    except (OSError, ElementTree.ParseError):
        return None


def main() -> None:
    """Expand the file of the command line."""
    path = Path(sys.argv[1])
    arguments = dict(argument.split(":=", 1) for argument in sys.argv[2:])
    import xacro

    def find(package_name: str, print_warning: bool = True) -> str:
        del print_warning
        return find_package(package_name, path)

    # xacro asks this function for the packages of `$(find NAME)`
    packages.get_package_share_directory = find
    try:
        text = xacro.process_file(str(path), mappings=arguments, verbosity=0).toxml()
    except Exception as error:  # whatever an expression in the file raises
        reason = " ".join(str(error).split()) or type(error).__name__
        sys.exit(reason[:500])
    sys.stdout.buffer.write(text.encode())


if __name__ == "__main__":
    main()
