"""Runs a scene: simulator and controllers in one process, a recorder, and a viewer."""

from collections.abc import Mapping
from pathlib import Path

from actuated_characters.runs.execution import (
    run_environment,
    wait_for_end,
    watch,
)
from actuated_characters.runs.in_process import Progress
from actuated_characters.runs.plan import RUN_DEFAULTS
from actuated_characters.runs.processes import Children
from actuated_characters.scenes.scene import SIMULATOR, Scene
from msgs_config.errors import RunError
from msgs_config.messages.clock import FIRST_TICK
from msgs_config.messages.session import SESSION, make_session


def play_scene(
    scene: Scene,
    directory: Path,
    ticks: int,
    *,
    viewer: Mapping[str, object] | None,
    last_megabytes: float = 0.0,
    progress: Progress = lambda ticks: None,
) -> int:
    """Run a scene for so many ticks; leaves bag and figures in a directory, which was prepared.

    With parameters of a viewer, it is shown in a browser. An interruption ends it in good order.
    The bag keeps so many MB of the last messages at least, and twice that at most; 0: all of them.
    Returns how many ticks there were, about; none if it was interrupted before the first one.

    Raises:
        RunError: one of the processes failed.
    """
    session = ("-p", f"{SESSION.name}:={make_session(f'/{SIMULATOR}')}")
    recording = {
        "directory": str(directory),
        "characters": scene.characters,
        "last_megabytes": last_megabytes,
    }
    done, interrupted = 0, False

    def report(count: int) -> None:
        nonlocal done
        done = max(done, count)  # a reset sets the count back
        progress(count)

    with run_environment(directory) as environment, Children(directory, environment) as children:
        told = report if viewer is None else _show(children, viewer, report)
        recorder = children.start_node("recorder", {**recording, "progress_period": 0.1}, *session)
        try:
            loop = children.start_composed("composed", _parameters(scene, ticks), *session)
            wait_for_end(loop, [recorder], told)
            report(ticks)
        except KeyboardInterrupt:
            interrupted = True
    if interrupted and done <= FIRST_TICK:
        return 0
    if recorder.exit_code:
        raise RunError(f"recorder failed: {recorder.last_words()}")
    return done


def _show(children: Children, viewer: Mapping[str, object], progress: Progress) -> Progress:
    """Start a viewer, as `watch`. Raises RunError if it fails at once: there is nothing to see."""
    shown = children.start_node("viewer", viewer)
    progress = watch(shown, progress)
    if shown.exit_code is not None:
        raise RunError(f"viewer failed: {shown.last_words()}")
    return progress


def _parameters(scene: Scene, ticks: int) -> dict[str, dict[str, object]]:
    """The nodes' parameters, with which they wait for each other and for the recorder."""
    heard_by = [str(values.get("opponent", "")) for values in scene.nodes.values()]
    others = min(map(heard_by.count, scene.characters), default=0)  # controllers of opponents
    nodes = {name: {"wait_for_subscribers": 2, **given} for name, given in scene.nodes.items()}
    simulator = {**RUN_DEFAULTS, **scene.simulator}
    nodes[SIMULATOR] = {**simulator, "wait_for_subscribers": 2 + others, "max_ticks": ticks}
    return nodes
