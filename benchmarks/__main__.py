"""`make bench`: all measurements, or with `--only NAME` one of them."""

import argparse
import os
import sys

from msgs_config.process import limit_threads

limit_threads()

from rich.console import Console  # noqa: E402 - after the limit on threads

from benchmarks.control_law import measure_control_laws  # noqa: E402
from benchmarks.cost import measure_cost  # noqa: E402
from benchmarks.lockstep import measure_lockstep  # noqa: E402
from benchmarks.realtime import measure_realtime  # noqa: E402
from benchmarks.recorder import measure_recorder  # noqa: E402
from benchmarks.replay import measure_replay  # noqa: E402
from benchmarks.samcon import measure_samcon  # noqa: E402
from benchmarks.search import measure_search  # noqa: E402
from experiment.domain import own_domain  # noqa: E402

_WIDTH = 100  # characters; enough for every table
_MEASUREMENTS = {
    "lockstep": measure_lockstep,
    "laws": measure_control_laws,
    "search": measure_search,
    "cost": measure_cost,
    "realtime": measure_realtime,
    "samcon": measure_samcon,
    "recorder": measure_recorder,
    "replay": measure_replay,
}


def main() -> int:
    """Measure and print the tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--only", choices=_MEASUREMENTS, help="the one to measure")
    only = parser.parse_args().only
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    console = Console(width=_WIDTH)
    with own_domain() as domain:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        for name, measure in _MEASUREMENTS.items():
            if only in (None, name):
                measure(console)
    return 0


if __name__ == "__main__":
    sys.exit(main())
