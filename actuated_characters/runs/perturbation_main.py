"""The process that sends a run's planned pushes and throws."""

from typing import NoReturn

from msgs_config.runtime.process import run_node


def main() -> NoReturn:
    """Run the node until a signal."""
    run_node("actuated_characters.runs.perturbation_node:PerturbationNode")


if __name__ == "__main__":
    main()
