"""Makes a complete bag of the files that a killed recorder, a full disk or a broken copy left."""

import shutil
from dataclasses import dataclass, field
from pathlib import Path

from actuated_characters.bags.directory_lock import DirectoryLock, find_writer
from actuated_characters.bags.format.metadata import BAG, METADATA
from actuated_characters.bags.format.storage import reason
from actuated_characters.bags.reader import read_messages
from actuated_characters.bags.rewriting import Progress, RecoveredContents, rewrite, storage_files
from actuated_characters.metrics.collector import CONFIGURATION, HEARD, MetricsCollector
from actuated_characters.recorder.run_directory import SUMMARY, metrics_directory, write_metrics
from msgs_config.errors import ActuatedCharactersError, RecordingError
from msgs_config.messages import topics
from msgs_config.messages.cdr import decode_string
from msgs_config.messages.configuration import parse_world

_DAMAGED_SUFFIX, _SCRATCH_SUFFIX = ".damaged", ".recovering"
_REPORT_PERIOD = 1000  # messages between two reports


@dataclass
class Recovered:
    """The result of `recover`, and where it is."""

    bag: Path
    contents: RecoveredContents
    damaged: Path | None  # the original; None where the bag was complete and nothing was done
    measured: list[Path] = field(default_factory=list)  # directories with figures rebuilt
    unchanged: list[Path] = field(default_factory=list)  # those with the recorder's own figures
    unmeasured: str = ""  # why a run's directory got no figures


def recover(path: Path, progress: Progress = lambda stage, fraction: None) -> Recovered:
    """Make a bag complete that is not, in its place; the original stays beside it as `.damaged`.

    Every message of a chunk that is whole is kept, with its type's definition and its publishers'
    quality of service. A run's directory gets the figures that it lacks. A bag that is complete is
    not touched. A recovery that is killed does no harm: the next call goes on.

    Args:
        path: A run's directory, or a bag: the directory that its files lie in.
        progress: Gets the stage, and the fraction of it that is done if that is known.

    Raises:
        RecordingError: there is nothing to recover, the recorder is still at work, the disk is
            full, or the original of an earlier recovery is in the way.
    """
    try:
        is_run = any((path / f"{BAG}{end}").is_dir() for end in ("", _DAMAGED_SUFFIX))
        bag = path / BAG if is_run else path
        if bag.name in ("", ".."):
            bag = bag.resolve()
        _finish_swap(bag)
        recovered = _recover_bag(bag, progress)
        if is_run:
            _measure(path, recovered, progress)
        return recovered
    except OSError as error:
        raise RecordingError(f"cannot recover {path}: {reason(error)}") from error


def _recover_bag(bag: Path, progress: Progress) -> Recovered:
    if not bag.is_dir():
        hint = "; give the directory that it lies in" if bag.is_file() else ""
        raise RecordingError(f"nothing to recover: {bag} is no directory{hint}")
    contents = _read_whole(bag, progress)
    if contents is not None:
        return Recovered(bag, contents, None)
    damaged, scratch = bag.with_name(bag.name + _DAMAGED_SUFFIX), _scratch(bag)
    if damaged.exists():
        raise RecordingError(f"{damaged} is in the way: what an earlier recovery kept; move it")
    try:
        lock = DirectoryLock(bag)
    except BlockingIOError as error:
        raise RecordingError(f"a recorder is still at work on {bag}; end it first") from error
    try:
        writer = find_writer(storage_files(bag))  # another kind of recorder, which locks nothing
        if writer is not None:
            raise RecordingError(f"process {writer} is still writing to {bag}; end it first")
        shutil.rmtree(scratch, ignore_errors=True)  # left by a recovery that was killed
        contents = rewrite(bag, scratch / bag.name, progress)
        bag.rename(damaged)
        _finish_swap(bag)
    finally:
        lock.release()
        if bag.exists():
            shutil.rmtree(scratch, ignore_errors=True)
    return Recovered(bag, contents, damaged)


def _scratch(bag: Path) -> Path:
    return bag.with_name(bag.name + _SCRATCH_SUFFIX)


def _finish_swap(bag: Path) -> None:
    """Put the new bag where the old one was; also for a recovery that was killed before that."""
    new = _scratch(bag) / bag.name
    if not bag.exists() and (new / METADATA).is_file():
        new.rename(bag)
        shutil.rmtree(new.parent, ignore_errors=True)


def _read_whole(bag: Path, progress: Progress) -> RecoveredContents | None:
    """Count the messages of a bag that can be read to its end; None for any other."""
    contents = RecoveredContents()
    progress("checking", None)
    try:
        for message in read_messages(bag):
            contents.add(message.topic, message.log_time_ns)
    except RecordingError:
        return None
    return contents


def _measure(run: Path, recovered: Recovered, progress: Progress) -> None:
    """Make the figures of each character in a bag, as its recorder would have made them.

    Those that are there stay: a recorder whose disk is full measures on, to the run's end.
    """
    suffix = f"/{CONFIGURATION}"
    namespaces = [
        name.removesuffix(suffix) for name in recovered.contents.counts if name.endswith(suffix)
    ]
    try:
        is_alone = len(namespaces) == 1 and not _name_in_world(recovered.bag, namespaces[0])
        places = {each: metrics_directory(run, each, is_alone=is_alone) for each in namespaces}
        made = {each: place for each, place in places.items() if not (place / SUMMARY).exists()}
        if recovered.damaged is not None:
            recovered.unchanged = [place for each, place in places.items() if each not in made]
        collectors = {each: MetricsCollector(f"{each}/{topics.SIM_NODE}"[1:]) for each in made}
        if collectors:
            _collect(recovered, collectors, progress)
        for namespace, collector in collectors.items():
            write_metrics(made[namespace], *collector.results())
            recovered.measured.append(made[namespace])
        if not namespaces and not (run / SUMMARY).exists():
            recovered.unmeasured = f"it has no '{CONFIGURATION}'"
    except ActuatedCharactersError as error:
        recovered.unmeasured = str(error)


def _name_in_world(bag: Path, namespace: str) -> str:
    """Return the name of the character in a namespace; empty if it has none in its world."""
    message = next(read_messages(bag, [f"{namespace}/{CONFIGURATION}"]))
    return parse_world(decode_string(message.raw)).name


def _collect(
    recovered: Recovered, collectors: dict[str, MetricsCollector], progress: Progress
) -> None:
    total = recovered.contents.counts.total()
    for count, message in enumerate(read_messages(recovered.bag)):
        if count % _REPORT_PERIOD == 0:
            progress("measuring", count / total)
        for namespace, collector in collectors.items():
            shared = message.topic == topics.DIAGNOSTICS.name
            name = message.topic if shared else message.topic.removeprefix(f"{namespace}/")
            if name in HEARD:
                collector.take(name, message.raw, message.published_ns)
