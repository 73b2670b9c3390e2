"""What every node's process does alike: threads, signals, one clear line for an error.

Imports neither numpy nor rclpy at the top: the limit on threads must come before numpy loads.
"""

import os
import signal
import sys
from collections.abc import Callable
from types import FrameType

from msgs_config.errors import ActuatedCharactersError

EXIT_ERROR = 1


def limit_threads() -> None:
    """Keep numpy's linear algebra on one thread: on matrices this small more only get in the way.

    To be called before numpy is imported; what the user has set stays.
    """
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")


class StopSignal:
    """Becomes true at SIGINT or SIGTERM, so that a loop can end in good order."""

    def __init__(self) -> None:
        self._received = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._receive)

    def __bool__(self) -> bool:
        return self._received

    def _receive(self, number: int, frame: FrameType | None) -> None:
        del number, frame
        self._received = True


def run_node(work: Callable[[StopSignal], None]) -> int:
    """Run a node's work between rclpy's start and end; returns the process's exit code.

    rclpy's own signal handlers would end the context under a loop that still has something to
    publish or to write, so the work is handed a `StopSignal` instead.
    """
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    stop = StopSignal()
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        work(stop)
    except ActuatedCharactersError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        return EXIT_ERROR
    except rclpy.exceptions.ROSInterruptException:
        return 0
    finally:
        rclpy.try_shutdown()
    return 0
