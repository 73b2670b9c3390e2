"""`python -m actuated_characters.compile_all`: what is computed often is compiled, and kept.

Else that which the planner, the renderer, inverse kinematics and batches compute is compiled at the
first plan, picture, pose and step. `--runs` leaves out batches, which training alone needs, and
which take nearly half of it.
"""

import sys

from actuated_characters.batch.worlds import Batch
from actuated_characters.render.engine.renderer import FrameSpec, Renderer
from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import make_plan
from controller_node.references.posing import Posing
from sim_node.physics.engine import INSTALLED_ENGINES

_SIZE = (64, 48)  # pixels


def main() -> None:
    """Plan a few ticks of a walk in a world of each engine, draw the last one, and step a batch."""
    clip = {"reference": "clip", "clip": "walk"}
    predictive = {"planner": "predictive", "plan.samples": 8, "plan.rounds": 1}
    for engine in INSTALLED_ENGINES:
        simulator = {"engine": engine, "command_delay_ticks": 1}
        for planner in (predictive, {"planner": "policy"}):
            plan = make_plan("humanoid", 0.05, clip, simulator, planner)
            *_, last = ticks_in_process(plan)
    Renderer(plan.character, skinned=True).picture(FrameSpec(last.following.position), _SIZE)
    rest = plan.character.layout.configuration(last.following.position)
    Posing(plan.character).fit(rest, [])
    if sys.argv[1:] == ["--runs"]:
        return
    with Batch(plan.character, 1, threads=1, clip="walk") as batch:
        batch.step()


if __name__ == "__main__":
    main()
