"""What the recorder is set to."""

from actuated_characters.bags.format.storage import (
    COMPRESSIONS,
    LOG_TIMES,
    NONE,
    WALL,
)
from msgs_config.messages.session import GivenSession
from msgs_config.settings import Settings, parameter


class RecorderSettings(Settings):
    """What is recorded, of whom, and where to."""

    directory: str = parameter(
        "recording",
        "where bag, summary.json and measurements.csv go; the figures of each of the parameter "
        "characters go to a folder of its name in there",
    )
    characters: tuple[str, ...] = parameter(
        (),
        "characters that are recorded, each in its namespace below the recorder's; none: "
        "the one in the recorder's own namespace",
    )
    write_bag: bool = parameter(True, "write the bag; without it the recorder only measures")
    last_megabytes: float = parameter(
        0.0,
        "how much of the last messages the bag keeps at least, and twice that at most; 0: all",
        unit="MB",
    )
    compression: str = parameter(NONE, "how the bag is compressed", choices=COMPRESSIONS)
    log_time: str = parameter(
        WALL,
        "clock of the bag's log times, by which players play it: simulated time is that of each "
        "message's stamp, or of the last state before it",
        choices=LOG_TIMES,
    )
    topics: tuple[str, ...] = parameter(
        (), "names of topics to record beside those of the contract"
    )
    sensors: tuple[str, ...] = parameter((), "topics of sensors to record, such as imu/NAME")
    exclude: tuple[str, ...] = parameter((), "names of topics of the contract not to record")
    session: GivenSession = GivenSession()
    forked_from: str = parameter(
        "", "what the run was forked from: JSON, for the bag's metadata and summary.json"
    )
    progress_period: float = parameter(0.0, "print the tick this often; 0: never", unit="s")

    @property
    def names(self) -> tuple[str, ...]:
        """The characters' names; that of one alone in the namespace is empty."""
        return self.characters or ("",)


PARAMETERS = RecorderSettings.declared()
