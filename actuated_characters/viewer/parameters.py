"""What the viewer is set to."""

from actuated_characters.viewer.web.request_check import LOOPBACK
from msgs_config.settings import Settings, parameter

SHOWN = {
    "reference": "Reference",
    "forces": "Contacts and pushes",
    "balance": "Centre of mass and support",
    "torques": "Torques against limits",
    "skin": "Skin",
}
"""What is drawn beside the character itself, and what the panel calls it."""


TOUCH = "touch"
"""The folder for drags and balls."""


class ViewerSettings(Settings):
    """Where the page is, and how often it is drawn."""

    host: str = parameter(LOOPBACK, "address to listen on; others than 127.0.0.1 let others in")
    port: int = parameter(0, "port to listen on; 0: the first free one from 8080 on", maximum=65535)
    about: str = parameter("", "Markdown that stands on the page: what there is to see, and to do")
    controls: tuple[str, ...] = parameter(
        (),
        "parameters that come first on the page: NODE.NAME of one that it has anyway, or a slider, "
        "'NODE.NAME LEAST MOST STEP LABEL'",
    )
    curves: tuple[str, ...] = parameter((), "degrees of freedom that are drawn over time")
    hidden: tuple[str, ...] = parameter((), f"what is not shown at first, of: {', '.join(SHOWN)}")
    opened: tuple[str, ...] = parameter((), f"folders that are open at first, of: {TOUCH}")
    skin: str = parameter("", "file of a skinned mesh (.glb) as the body of every character")
    skin_map: str = parameter("", "YAML file of that mesh's joints by links")
    fps: float = parameter(30.0, "most pictures a second", unit="Hz", minimum=1.0, maximum=120.0)


PARAMETERS = ViewerSettings.declared()
