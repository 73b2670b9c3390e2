"""A command in a process that is there before it is needed: it has imported and compiled by then.

It reads the command's arguments, a list in JSON, as the first line of its standard input.
"""

import json
import os
import select
import sys
from contextlib import suppress

from actuated_characters.cli import main
from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.planned.timeline import plan_timeline
from actuated_characters.timeline import taking  # noqa: F401  what takes long to import
from msgs_config.errors import ActuatedCharactersError
from msgs_config.messages import typed


def _prepare() -> None:
    """Do once what a take does: a tick of a character that is planned for."""
    typed.types()
    with suppress(ActuatedCharactersError):  # the command will say what is wrong
        plan = plan_timeline("bow", {}, {}).plan
        for _ in ticks_in_process(plan.lasting(1)):
            pass


if __name__ == "__main__":
    if not select.select([sys.stdin], [], [], 0.0)[0]:  # else it is asked for already
        _prepare()
    line = sys.stdin.readline()
    code = main(json.loads(line)) if line else 0
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # all that was opened is closed; taking the modules down takes 0.3 s
