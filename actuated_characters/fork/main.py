"""The process that repeats what a recorded run was sent."""

from typing import NoReturn

from msgs_config.runtime.process import run_node


def main() -> NoReturn:
    """Run the node until a signal."""
    run_node("actuated_characters.fork.node:ForkNode", listens=True)


if __name__ == "__main__":
    main()
