"""Pictures that no study makes, the reference an outline: `python -m benchmarks.pictures`.

Those of docs/planning.md, all clips at some of their moments and two moving pictures, the README's
and the moving one of docs/lecture.md. It takes a quarter of an hour; `--only hero.webp` makes one.
"""

import argparse
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image
from rich.console import Console
from rich.progress import track

from actuated_characters.bags.recording import Recording, read_recording
from actuated_characters.recorder.run_directory import prepare_directory
from actuated_characters.render.engine.renderer import Picture
from actuated_characters.render.films import write_film
from actuated_characters.render.movie import GhostPlace, Movie, MovieSettings
from actuated_characters.render.stills import pose_strip
from actuated_characters.runs.in_process import run_in_process
from actuated_characters.runs.plan import make_plan
from actuated_characters.runs.planned.inputs import PlannedInputs
from actuated_characters.runs.planned.wrenches import parse_push
from lecture.framework.runner import Runner
from lecture.gains import FACTORS
from lecture.gains.step import film, run_steps
from msgs_config.character.loading import load_character
from msgs_config.clips.reading import available_clips, read_clip

MOMENTS = 8
TILE, FRAME, WIDE = (150, 170), (400, 260), (640, 360)  # pixels
FRAMES_A_SECOND = 20
CLIPS, GAINS = "planned_clips.webp", "gains_step.webp"
SIDEWAYS, FORWARDS = "root:0,300,0@1.5", "root:240,0,0@5.5"  # N, for 0.2 s
Motion = tuple[str, float, tuple[str, ...]]
MOVING: dict[str, tuple[tuple[int, int], list[Motion]]] = {
    "planned_backflip.webp": (FRAME, [("backflip", 1.75, ())]),
    "planned_pushes.webp": (FRAME, [("walk", 9.5, (SIDEWAYS, FORWARDS))]),
    "hero.webp": (WIDE, [("walk", 4.0, (SIDEWAYS,)), ("backflip", 1.75, ())]),
}
"""By file its size, and of each run its clip, duration in s and pushes."""


def main() -> int:
    """Simulate, draw and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path("docs/pictures"), help="(%(default)s)")
    parser.add_argument("--only", choices=(CLIPS, GAINS, *MOVING), help="the picture to make (all)")
    options = parser.parse_args()
    console = Console()
    if options.only in (None, CLIPS):
        humanoid = load_character("humanoid")
        clips = track(available_clips(humanoid), "clips", console=console)
        strips = [
            draw_strip(clip, simulate(clip, float(read_clip(humanoid, clip).times[-1])))
            for clip in clips
        ]
        Image.fromarray(np.concatenate(strips)).save(options.folder / CLIPS, quality=75)
    wanted = [name for name in MOVING if options.only in (None, name)]
    for name in track(wanted, "moving pictures", console=console):
        size, runs = MOVING[name]
        pictures = [each for run in runs for each in draw_movie(simulate(*run), size)]
        write_film(options.folder / name, pictures, len(pictures), size, FRAMES_A_SECOND)
    if options.only in (None, GAINS):
        pictures = film_gains()
        height, width, _ = pictures[0].shape
        write_film(
            options.folder / GAINS, pictures, len(pictures), (width, height), FRAMES_A_SECOND
        )
    return 0


def film_gains() -> list[Picture]:
    """A leg and both arms, lifted at once by the six pairs of gains of the study `gains`."""
    with TemporaryDirectory() as folder:
        runner = Runner(Path(folder), keep_runs=False, report=lambda label, share: None)
        runs = run_steps(runner, list(dict.fromkeys(FACTORS.values())))
        return film(FACTORS, runs, FRAMES_A_SECOND)


def simulate(clip: str, duration: float, texts: tuple[str, ...] = ()) -> Recording:
    """Plan a clip; returns what was recorded."""
    motion = {"reference": "clip", "clip": clip}
    simulator = {"wrench_duration": 0.2}
    plan = make_plan("humanoid", duration, motion, simulator, {"planner": "predictive"})
    with TemporaryDirectory() as folder:
        directory = Path(folder) / "run"
        prepare_directory(directory, overwrite=False)
        run_in_process(
            plan, directory, inputs=PlannedInputs([parse_push(text, plan) for text in texts])
        )
        return read_recording(directory)


def draw_strip(clip: str, run: Recording) -> Picture:
    """A clip at some of its moments, its name above the first."""
    rows = np.linspace(0, len(run.times) - 2, MOMENTS).round().astype(int)  # the last is unanswered
    captions = [clip, *[f"{time:.2f} s" for time in run.times[rows[1:]]]]
    poses, ghosts = run.position[rows], run.reference_position[rows]
    return pose_strip(run.character, poses, captions, ghosts=ghosts, columns=MOMENTS, size=TILE)


def draw_movie(run: Recording, size: tuple[int, int]) -> list[Picture]:
    """All of a run, its reference where it really is."""
    end = float(run.times[-2])  # nothing answers the last state
    settings = MovieSettings(fps=FRAMES_A_SECOND, end=end, size=size, ghost=GhostPlace.OVER)
    return list(Movie([run], settings).pictures())


if __name__ == "__main__":
    sys.exit(main())
