"""The executable `controller_node`."""

from typing import NoReturn

from msgs_config.runtime.process import run_node


def main() -> NoReturn:
    """Run the controller until a signal."""
    run_node("controller_node.node:ControllerNode")


if __name__ == "__main__":
    main()
