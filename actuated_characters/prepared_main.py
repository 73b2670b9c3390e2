"""A command in a process that is there before it is needed: its modules take a second to import.

It reads the command's arguments, a list in JSON, as the first line of its standard input.
"""

import json
import sys

from actuated_characters.cli import main
from actuated_characters.timeline import taking  # noqa: F401  what takes long to import

if __name__ == "__main__":
    line = sys.stdin.readline()
    sys.exit(main(json.loads(line)) if line else 0)
