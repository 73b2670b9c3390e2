"""`python -m actuated_characters.compile_all`: what is computed often is compiled, and kept.

Else that which the planner and the renderer compute is compiled at the first plan, and picture.
"""

import sim_node.physics.mujoco.world  # noqa: F401 - its functions are compiled as it is imported
from actuated_characters.render.engine.renderer import FrameSpec, Renderer
from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import make_plan

_SIZE = (64, 48)  # pixels


def main() -> None:
    """Plan a few ticks of a walk, and draw the last one."""
    clip = {"reference": "clip", "clip": "walk"}
    planner = {"planner": "predictive", "plan.samples": 8, "plan.rounds": 1}
    plan = make_plan("humanoid", 0.05, clip, {"command_delay_ticks": 1}, planner)
    *_, last = ticks_in_process(plan)
    Renderer(plan.character).picture(FrameSpec(last.following.position), _SIZE)


if __name__ == "__main__":
    main()
