"""The variables of the environment by which ROS nodes find each other, checked before they start.

Imports neither numpy nor rclpy.
"""

import re
from collections.abc import Mapping

from msgs_config.errors import ConfigurationError

DOMAIN_ID, DISCOVERY_RANGE = "ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE"
LOCALHOST = "LOCALHOST"

_LAST_DOMAIN = 232  # beyond it the ports of DDSI-RTPS 2.3, section 9.6.1.1, exceed 65535
_WHOLE_NUMBER = re.compile("0|[1-9][0-9]*")  # to rcl a leading zero means an octal number


def check_domain_id(environment: Mapping[str, str]) -> None:
    """Check the ROS domain that the environment names, if it names one.

    Raises:
        ConfigurationError: ROS_DOMAIN_ID is no whole number from 0 to 232.
    """
    text = environment.get(DOMAIN_ID, "")
    if not text or (_WHOLE_NUMBER.fullmatch(text) and int(text[:9]) <= _LAST_DOMAIN):
        return
    raise ConfigurationError(
        f"{DOMAIN_ID} is {text[:40]!r}; it must be a whole number, 0 to {_LAST_DOMAIN}"
    )


def is_discovery_off(environment: Mapping[str, str]) -> bool:
    """Whether no process may find another one: ROS_AUTOMATIC_DISCOVERY_RANGE is OFF."""
    return environment.get(DISCOVERY_RANGE, "") == "OFF"
