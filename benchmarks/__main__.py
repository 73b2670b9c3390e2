"""`make bench`: all measurements, or with `--only NAME` one of them; what got worse is red."""

import argparse
import os
import sys

from msgs_config.runtime.process import limit_threads, middleware_settings

limit_threads()

from msgs_config.errors import ConfigurationError  # noqa: E402 - after the limit on threads
from msgs_config.runtime.extras import require_extra  # noqa: E402

try:
    require_extra("view", "make bench")
except ConfigurationError as error:
    sys.exit(f"error: {error}")

from rich.console import Console  # noqa: E402

from actuated_characters.runs.ros_domain import own_domain  # noqa: E402
from benchmarks.control_law import measure_control_laws  # noqa: E402
from benchmarks.cost import measure_cost  # noqa: E402
from benchmarks.editing import measure_editing  # noqa: E402
from benchmarks.engines import measure_engines  # noqa: E402
from benchmarks.lockstep import measure_lockstep  # noqa: E402
from benchmarks.planning import measure_planning  # noqa: E402
from benchmarks.realtime import measure_realtime  # noqa: E402
from benchmarks.reconstruction import measure_reconstruction  # noqa: E402
from benchmarks.recorder import measure_recorder  # noqa: E402
from benchmarks.replay import measure_replay  # noqa: E402
from benchmarks.search import measure_search  # noqa: E402
from benchmarks.support.ratios import compare, comparison_table, read_ratios, store_ratios  # noqa: E402
from benchmarks.watching import measure_watching  # noqa: E402

_WIDTH = 100  # characters; enough for every table
_MEASUREMENTS = {
    "lockstep": measure_lockstep,
    "laws": measure_control_laws,
    "search": measure_search,
    "cost": measure_cost,
    "engines": measure_engines,
    "planning": measure_planning,
    "editing": measure_editing,
    "realtime": measure_realtime,
    "reconstruction": measure_reconstruction,
    "recorder": measure_recorder,
    "replay": measure_replay,
    "watching": measure_watching,
}


def main() -> int:
    """Measure and print the tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--only", choices=_MEASUREMENTS, help="the one to measure")
    parser.add_argument("--store", action="store_true", help="store the ratios as those to keep")
    options = parser.parse_args()
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    # Its nodes have them, too, or it may not hear them.
    os.environ.update(middleware_settings(os.environ))
    console, ratios = Console(width=_WIDTH), []
    stored = read_ratios()  # before all that takes minutes: the file may be malformed
    with own_domain() as domain:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        for name, measure in _MEASUREMENTS.items():
            if options.only in (None, name):
                ratios += measure(console)
    console.print(comparison_table(compare(ratios, stored)))
    if options.store:
        store_ratios(ratios)
    return 0


if __name__ == "__main__":
    sys.exit(main())
