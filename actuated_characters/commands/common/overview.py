"""What there is to see: scenes, characters, clips, and commands to copy."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from actuated_characters.commands.common.tables import make_table

_PROGRAM = "actuated_characters"
OVERVIEW = {
    "play": "a humanoid that walks in the browser, to be pushed; needs the extra 'view'",
    "play --scene brawl": "another scene",
    "play --scene drive": "a humanoid that the arrow keys steer; needs the extra 'view'",
    'run --machine walk --cmd-vel "0.9,0,0.3@1" --duration 10': "walks by laws of balance",
    "motion import my_capture.bvh": "a clip of your own capture, for --clip",
    "run --clip walk --duration 20 --planner hybrid": "a recorded run, and its figures",
    "run --timeline wave": "poses, pushes and steering in time, from a file",
    "run --view --clip run --planner policy": "in the browser, as any run with --view",
    "run --clip backflip --duration 1.75 --planner predictive": "by joint torques alone",
    "run --parameters controller_node": "all that --set can set of a node",
    "run --help": "all options",
}


def print_overview(options: argparse.Namespace) -> None:
    """Print what can be run, and how."""
    from actuated_characters.scenes.scene import load_scene, scene_names

    del options
    columns = ("name", "degrees of freedom", "mass", "clips")
    Console().print(make_table("characters", columns, _characters(), right=False))
    print("\nscenes:")
    for name in scene_names():
        print(f"  {name}: {load_scene(name).title}")
    typed = sys.argv[0]
    program = typed if Path(typed).name == _PROGRAM else _PROGRAM
    for words, about in OVERVIEW.items():
        print(f"\n# {about}\n{program} {words}")


def _characters() -> Sequence[tuple[str, ...]]:
    from msgs_config.character.file import shipped_characters
    from msgs_config.character.loading import load_character
    from msgs_config.clips.reading import available_clips

    rows = []
    for name in shipped_characters():
        character = load_character(name)
        clips = ", ".join(available_clips(character)) or "-"
        base = "floating" if character.layout.has_floating_base else "fixed"
        freedom = f"{character.layout.size}, {base} base"
        rows.append((name, freedom, f"{character.mass:.3g} kg", clips))
    return rows
