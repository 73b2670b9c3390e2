"""The parameters of the recorder."""

from actuated_characters.bags.format.storage import (
    COMPRESSIONS,
    LOG_TIME,
    LOG_TIMES,
    NONE,
    WALL,
)
from actuated_characters.recorder.forked_from import FORKED_FROM
from msgs_config.messages.session import SESSION
from msgs_config.parameters import Parameter

PARAMETERS = [
    Parameter(
        "directory",
        "recording",
        "where bag, summary.json and measurements.csv go; the figures of each of the parameter "
        "characters go to a folder of its name in there",
    ),
    Parameter(
        "characters",
        [],
        "characters that are recorded, each in its namespace below the recorder's; none: "
        "the one in the recorder's own namespace",
        texts=True,
    ),
    Parameter("write_bag", True, "write the bag; without it the recorder only measures"),
    Parameter(
        "last_megabytes",
        0.0,
        "how much of the last messages the bag keeps at least, and twice that at most; 0: all",
        unit="MB",
    ),
    Parameter("compression", NONE, "how the bag is compressed", choices=COMPRESSIONS),
    Parameter(
        LOG_TIME,
        WALL,
        "clock of the bag's log times, by which players play it: simulated time is that of each "
        "message's stamp, or of the last state before it",
        choices=LOG_TIMES,
    ),
    Parameter("topics", [], "names of topics to record beside those of the contract", texts=True),
    Parameter(
        "sensors",
        [],
        "topics of sensors to record, such as imu/NAME",
        texts=True,
    ),
    Parameter("exclude", [], "names of topics of the contract not to record", texts=True),
    SESSION,
    FORKED_FROM,
    Parameter("progress_period", 0.0, "print the tick this often; 0: never", unit="s"),
]
