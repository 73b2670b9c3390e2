"""How the planner's functions are compiled."""

from pathlib import Path

from controller_node.references import offsets
from msgs_config.compiled.decorator import Compiler

compiled = Compiler(*Path(__file__).parent.glob("*.py"), Path(offsets.__file__))
