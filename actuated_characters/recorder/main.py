"""The executable `recorder`."""

from typing import NoReturn

from msgs_config.runtime.process import run_node


def main() -> NoReturn:
    """Run the recorder until a signal."""
    run_node("actuated_characters.recorder.node:RecorderNode", listens=True)


if __name__ == "__main__":
    main()
