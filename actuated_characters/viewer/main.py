"""The executable `viewer`."""

import os
from typing import NoReturn

from msgs_config.runtime.process import run_node

_NICE = 5  # pictures can wait on a busy machine, ticks cannot
_ABOUT = """\
Shows all characters of the simulators in its namespace in a browser, at the address that it prints.

"""


def main() -> NoReturn:
    """Run the viewer until a signal."""
    os.nice(_NICE)
    run_node("actuated_characters.viewer.node:ViewerNode", _ABOUT, listens=True, extra="view")


if __name__ == "__main__":
    main()
