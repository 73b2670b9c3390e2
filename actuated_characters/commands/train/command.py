"""The command `actuated_characters train`: a policy that keeps a motion by joint torques alone."""

import argparse
import signal
import time
from pathlib import Path
from typing import TYPE_CHECKING

from actuated_characters.commands.common.progress import progress_bar, say
from actuated_characters.commands.common.settings import Commands, add_character, add_command

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.training.training import Look, Progress, Training

DECISIONS_A_MINUTE = 500_000  # on two processors
FOLDER, SUFFIX = Path("policies"), ".npz"


def add_train(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command."""
    command = add_command(
        commands,
        _train,
        "train",
        "train a policy that keeps a motion by joint torques alone",
        "Train a small network that answers each state with offsets to a motion's angles, as a "
        "planner does, by trying in many worlds at once (proximal policy optimisation). Ctrl-C "
        "ends it and keeps the best so far. Play the result with `run --clip CLIP --planner policy "
        "--set controller_node.policy:=FILE`; the last lines say how.",
        [
            "train --clip walk --minutes 10",
            "train --clip walk --pushes 60 --output walk.npz",
            "train --steer --minutes 40 --from walk",
        ],
    )
    add_character(command)
    _add_what(command)
    _add_network(command)
    _add_how(command)


def _add_what(command: argparse.ArgumentParser) -> None:
    """Add what is to be learned, and how hard."""
    command.add_argument(
        "--clip",
        action="append",
        metavar="NAME",
        help="name of a clip, a file, or a folder of files; may be repeated: one policy for all of "
        "them (walk)",
    )
    command.add_argument(
        "--steer",
        action="store_true",
        help="learn to go where cmd_vel says, by the clips of `--reference steered`; beside "
        "clips, where --clip names some",
    )
    command.add_argument(
        "--after",
        action="append",
        default=[],
        metavar="CLIP",
        help="learn to go over to the motion from where another clip ends, too, or, after `fall`, "
        "from how a limp body lies, as active_ragdoll and reactive do when they get up; may be "
        "repeated",
    )
    command.add_argument(
        "--minutes",
        type=float,
        default=10.0,
        metavar="M",
        help=f"how much is tried, in all: {DECISIONS_A_MINUTE:,} decisions each, which take that "
        "long on two processors (%(default)g)",
    )
    command.add_argument(
        "--pushes",
        type=float,
        default=25.0,
        metavar="NS",
        help="impulse, in N s, of the hardest pushes that it learns to take; 0: none (%(default)g)",
    )


def _add_how(command: argparse.ArgumentParser) -> None:
    """Add how it is computed, and where the result goes."""
    command.add_argument("--seed", type=int, default=0, help="of all random numbers (0)")
    command.add_argument(
        "--output",
        type=Path,
        metavar="FILE",
        help=f"the policy ({FOLDER}/CHARACTER-CLIP{SUFFIX})",
    )
    command.add_argument("--overwrite", action="store_true", help="replace FILE")
    command.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="controller_node.NAME:=VALUE",
        help="a parameter, such as rate, gains or plan.weight; may be repeated",
    )
    command.add_argument(
        "--threads", type=int, metavar="N", help="of the worlds (one for each processor)"
    )


def _add_network(command: argparse.ArgumentParser) -> None:
    """Add what network learns, and from whom."""
    start = command.add_mutually_exclusive_group()
    start.add_argument(
        "--resume", action="store_true", help="go on with the training in FILE, if there is one"
    )
    start.add_argument(
        "--from",
        metavar="POLICY",
        help="begin with what a shipped policy, or one in a file, can, of whatever motion",
    )
    command.add_argument(
        "--imitate",
        action="extend",
        nargs="*",
        metavar="POLICY",
        help="learn from what other policies, each of some of the clips, would have done, at first "
        "from that alone (those that are shipped)",
    )
    command.add_argument(
        "--hidden",
        type=int,
        metavar="N",
        help="units of each of the network's two layers; many clips need more (128)",
    )


def _train(options: argparse.Namespace) -> None:
    # It takes a second to import.
    from actuated_characters.commands.train import outcome, preparing
    from actuated_characters.training.training import Training

    exercises, output = preparing.asked_for(options)
    began = time.process_time()
    job = preparing.taught(options, preparing.job_of(options, exercises))
    start = preparing.start_of(options, job, output)
    output.parent.mkdir(exist_ok=True)
    training = Training(job, start, resumes=options.resume)
    title = f"{job.character.name}: {', '.join(preparing.few(job.names))}"
    try:
        spent = _go_on(training, title, job.decisions, output), time.process_time() - began
    finally:
        training.close()
    trials = outcome.try_policy(options, exercises, output)
    outcome.report(training, output, trials, spent)
    if trials:
        outcome.show_run(options, exercises[0], output)
    for exercise in exercises:
        outcome.say_how_to_play(options, exercise, output)


def _go_on(training: "Training", title: str, decisions: int, output: Path) -> float:
    """Train to the end, or to Ctrl-C; the policy is in its file then. Returns wall seconds."""
    began = time.monotonic()
    try:
        with progress_bar(title, decisions, "decisions") as bar:
            while not training.is_over:
                progress = training.go_on()
                bar.update(bar.task_ids[0], completed=progress.decisions, state=_words(progress))
                look = progress.look
                if look and look.is_better:
                    training.save(output, {})
                if look and not bar.console.is_terminal:  # the bar shows nothing until the end
                    words = f"{_words(progress)}; {_verdict(look)}"
                    say(f"{progress.decisions:,} of {decisions:,}: {words}")
    except KeyboardInterrupt as interrupted:
        if not training.has_best:
            raise  # so soon there is nothing better than what FILE may have
        if interrupted.args == (signal.SIGTERM,):
            training.save(output, {})
            raise  # who says so does not wait for runs
        say(f"interrupted; the best so far is in {output}, and is tried (Ctrl-C leaves that out)")
    training.save(output, {})
    return time.monotonic() - began


def _words(progress: "Progress") -> str:
    return (
        f"lasts {progress.survived_s:.1f} s, pushes {progress.push:.0f} N s, "
        f"off {progress.off_m:.2f} m {progress.off_rad:.2f} rad"
    )


def _verdict(look: "Look") -> str:
    kept = "best so far" if look.is_better else "not kept"
    return f"by itself {look.falls} falls in {look.seconds:.0f} s: {kept}"
