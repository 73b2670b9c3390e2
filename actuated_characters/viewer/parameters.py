"""What the viewer is set to."""

from actuated_characters.viewer.web.request_check import LOOPBACK
from msgs_config.settings import Settings, parameter


class ViewerSettings(Settings):
    """Where the page is, and how often it is drawn."""

    host: str = parameter(LOOPBACK, "address to listen on; others than 127.0.0.1 let others in")
    port: int = parameter(0, "port to listen on; 0: the first free one from 8080 on", maximum=65535)
    fps: float = parameter(30.0, "most pictures a second", unit="Hz", minimum=1.0, maximum=120.0)


PARAMETERS = ViewerSettings.declared()
