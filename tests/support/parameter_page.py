"""The page of all parameters, from their declarations: `python -m tests.support.parameter_page`."""

from collections.abc import Sequence
from pathlib import Path

from actuated_characters.recorder import parameters as recorder
from actuated_characters.ros2_control import parameters as bridge
from controller_node import parameters as controller
from msgs_config.character.loading import load_character
from msgs_config.parameters import Parameter
from sim_node import parameters as simulator

PAGE = Path(__file__).parents[2] / "docs" / "parameters.md"
EXAMPLE, JOINT = "pendulum", "hinge"
HEAD = """\
# Parameters

`run --set NODE.NAME:=VALUE`, `--ros-args -p NAME:=VALUE` and parameter files set them; those
marked *live* may change while the node runs, as may those marked *next reset*, which count from the
first state of the next episode on. With several `characters`, those of one are set below its name.
`actuated_characters run --parameters NODE --character NAME` prints those of a character's run.
"""


def section(title: str, parameters: Sequence[Parameter]) -> str:
    rows = [f"## {title}", "", "| name | default | meaning |", "| --- | --- | --- |"]
    for each in parameters:
        choices = f": {', '.join(f'`{choice}`' for choice in each.choices)}" if each.choices else ""
        change = f" (*{each.when_changed}*)" if each.when_changed else ""
        name = each.name.replace(JOINT, "JOINT")
        about = each.description.replace(f"'{JOINT}'", "the joint") + choices + change
        rows.append(f"| `{name}` | {default(each)} | {about.replace('|', '/')} |")
    return "\n".join(rows) + "\n"


def default(parameter: Parameter) -> str:
    value = parameter.choices[0] if parameter.name == "engine" else parameter.default
    depends = parameter.name.startswith(("gains.", "effort_limit.", "initial_p", "initial_v"))
    if depends or parameter.name == "commanded_joints":
        return f"the character's, {parameter.unit}".rstrip(", ")
    if isinstance(value, list):
        text = ", ".join(f"{each:g}" if isinstance(each, float) else each for each in value)
        text = f"[{text}]"
    elif isinstance(value, bool):
        text = str(value).lower()
    else:
        text = f"{value:g}" if isinstance(value, float) else str(value)
    return f"`{text}` {parameter.unit}".rstrip() if text else "none"


def content() -> str:
    character = load_character(EXAMPLE)
    nodes = {
        "sim_node": [
            simulator.CHARACTERS,
            *simulator.PARAMETERS,
            *simulator.character_parameters(character),
        ],
        "controller_node": [
            *controller.PARAMETERS,
            *controller.character_parameters(character),
        ],
        "recorder": recorder.PARAMETERS,
        "ros2_control_bridge": bridge.declared(character),
    }
    return "\n".join([HEAD, *(section(f"`{node}`", each) for node, each in nodes.items())])


if __name__ == "__main__":
    PAGE.write_text(content(), encoding="utf-8")
