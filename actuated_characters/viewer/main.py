"""The executable `viewer`."""

import os
from collections.abc import Callable
from typing import NoReturn

from msgs_config.extras import require_extra
from msgs_config.runtime.process import RunnableNode, limit_threads, run_node, use_batch_scheduling

_NICE = 5  # pictures can wait on a busy machine, ticks cannot
_ABOUT = """\
Shows all characters of the simulators in its namespace in a browser, at the address that it prints.

"""


def main() -> NoReturn:
    """Run the viewer until a signal."""
    limit_threads()
    use_batch_scheduling()
    os.nice(_NICE)
    run_node(_load, _ABOUT)


def _load() -> Callable[[], RunnableNode]:
    require_extra("view", "the viewer")
    from actuated_characters.viewer.node import ViewerNode

    return ViewerNode


if __name__ == "__main__":
    main()
