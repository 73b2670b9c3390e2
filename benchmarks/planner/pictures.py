"""The pictures of docs/planning.md: `python -m benchmarks.planner.pictures`.

Planned motion over the capture, which is transparent: all clips at some of their moments, and two
moving pictures, the backflip and a walk that is pushed. It takes a quarter of an hour.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from rich.console import Console
from rich.progress import track

from actuated_characters.render.captions import captioned
from actuated_characters.render.engine.renderer import Picture, Renderer
from actuated_characters.render.stills import pose_strip
from actuated_characters.runs.in_process import ticks_in_process
from actuated_characters.runs.plan import make_plan
from actuated_characters.runs.planned_wrenches import parse_pushes_within
from controller_node.references.files.clip import available_clips, read_clip
from msgs_config.arrays import FloatArray
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character

MOMENTS = 8
TILE, FRAME = (150, 170), (400, 260)  # pixels
FRAMES_A_SECOND = 20
PUSHES = ("root:0,300,0@1.5", "root:240,0,0@5.5")  # N, for 0.2 s
MOVING = {  # file: clip, duration in s, pushes
    "planned_backflip.webp": ("backflip", 1.75, ()),
    "planned_pushes.webp": ("walk", 9.5, PUSHES),
}


@dataclass(frozen=True)
class Seen:
    """What was simulated, tick by tick, and where the capture was."""

    character: Character
    positions: FloatArray  # (ticks, n)
    references: FloatArray  # (ticks, n)
    rate: int  # Hz

    def rows(self, frames_a_second: float) -> FloatArray:
        """Ticks, so many a second."""
        count = len(self.positions)
        return (
            np.arange(0, count, self.rate / frames_a_second).round().astype(int).clip(0, count - 1)
        )


def main() -> int:
    """Simulate, draw and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path("docs/pictures"), help="(%(default)s)")
    folder = parser.parse_args().folder
    console, humanoid = Console(), load_character("humanoid")
    strips = []
    for clip in track(available_clips(humanoid), "clips", console=console):
        seen = simulate(clip, float(read_clip(humanoid, clip).times[-1]))
        rows = np.linspace(0, len(seen.positions) - 1, MOMENTS).round().astype(int)
        captions = [clip, *[f"{row / seen.rate:.2f} s" for row in rows[1:]]]
        strips.append(
            pose_strip(
                seen.character,
                seen.positions[rows],
                captions,
                ghosts=seen.references[rows],
                columns=MOMENTS,
                size=TILE,
            )
        )
    Image.fromarray(np.concatenate(strips)).save(folder / "planned_clips.webp", quality=75)
    for name, (clip, duration, pushes) in track(MOVING.items(), "films", console=console):
        film(simulate(clip, duration, pushes), folder / name)
    return 0


def simulate(clip: str, duration: float, pushes: Sequence[str] = ()) -> Seen:
    """Plan a clip."""
    motion = {"reference": "clip", "clip": clip}
    plan = make_plan(
        "humanoid", duration, motion, {"wrench_duration": 0.2}, {"planner": "predictive"}
    )
    ticks = list(ticks_in_process(plan, parse_pushes_within(pushes, plan)))
    references = [tick.reference.position for tick in ticks if tick.reference is not None]
    positions = np.array([tick.state.position for tick in ticks])
    return Seen(plan.character, positions, np.array(references), plan.simulator.integer("rate"))


def film(seen: Seen, file: Path) -> None:
    """Write a moving picture that a page shows as it is."""
    rows = seen.rows(FRAMES_A_SECOND)
    pictures = [Image.fromarray(picture) for picture in _frames(seen, rows)]
    pictures[0].save(
        file,
        save_all=True,
        append_images=pictures[1:],
        duration=round(1000 / FRAMES_A_SECOND),
        loop=0,
        quality=45,
        method=4,
    )


def _frames(seen: Seen, rows: FloatArray) -> list[Picture]:
    positions, references = seen.positions[rows], seen.references[rows]
    with Renderer(seen.character) as camera:
        view = camera.view(np.concatenate((positions[:1], references[:1])), size=FRAME)
        return [
            captioned(
                camera.picture(
                    position,
                    ghost=reference,
                    view=camera.followed(view, positions[0], position),
                    size=FRAME,
                ),
                f"{row / seen.rate:.2f} s",
            )
            for row, position, reference in zip(rows, positions, references, strict=True)
        ]


if __name__ == "__main__":
    sys.exit(main())
