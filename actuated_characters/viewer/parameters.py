"""The parameters of the viewer."""

from actuated_characters.viewer.web.request_check import LOOPBACK
from msgs_config.parameters import Parameter

PARAMETERS = [
    Parameter("host", LOOPBACK, "address to listen on; others than 127.0.0.1 let others in"),
    Parameter("port", 0, "port to listen on; 0: the first free one from 8080 on", maximum=65535),
    Parameter("fps", 30.0, "most pictures a second", unit="Hz", minimum=1.0, maximum=120.0),
]
