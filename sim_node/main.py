"""The executable `sim_node`."""

from typing import NoReturn

from msgs_config.runtime.process import run_node


def main() -> NoReturn:
    """Run the simulator until its end or a signal."""
    run_node("sim_node.node:SimNode")


if __name__ == "__main__":
    main()
