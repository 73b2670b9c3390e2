"""Recovery of a bag by a command, and what it says of it."""

import sys
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from actuated_characters.commands.common.progress import progress_bar
from msgs_config.errors import RecordingError
from msgs_config.file_kinds import refuse_other_kind

_NS_PER_S = 10**9


def recover_bag(path: Path) -> None:
    """Make the bag of a run, or in a directory, complete; says on standard error what came of it.

    Raises:
        RecordingError: see `recover`.
    """
    from actuated_characters.recorder.recovery import recover

    refuse_other_kind(path, "a run or the directory of a bag", (), RecordingError)
    with progress_bar("", 1.0) as bar:

        def report(what: str, fraction: float | None) -> None:
            bar.update(bar.task_ids[0], description=what, completed=fraction or 0.0)

        recovered = recover(path, report)
    contents, say = recovered.contents, partial(print, file=sys.stderr)
    count = f"{contents.counts.total()} messages"
    if recovered.damaged is None:
        say(f"{recovered.bag} is complete ({count}): nothing to recover")
    else:
        last = datetime.fromtimestamp(contents.last_log_time_ns / _NS_PER_S, UTC)
        say(f"{recovered.bag}: {count}, the last one of {last:%F %T.%f} UTC")
        for part in contents.unreadable:
            say(f"unreadable: {part}")
        say(f"the damaged bag: {recovered.damaged}")
    for directory in recovered.measured:
        say(f"figures: {directory}")
    for directory in recovered.unchanged:
        say(f"figures: {directory}, as they were: of the whole run, the bag is a part of it")
    if recovered.unmeasured:
        say(f"no figures: {recovered.unmeasured}")
