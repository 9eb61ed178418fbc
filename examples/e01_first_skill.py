"""A first skill: a model says what can happen, a class of hooks does it. Here in one process and in virtual time.

It prints:

    TERMINATED LIT after 3.0 s
    lamp is ON
"""

from __future__ import annotations

from alula import Execution, LocalWorld, SkillHooks, parse_skillset

MODEL = """
skillset light {
  resource lamp { initial OFF  OFF -> ON  ON -> OFF }
  skill warm_up {
    input { seconds: float64 }
    effect { on: lamp -> ON }
    precondition { is_off: resource = (lamp == OFF) }
    result { LIT: apply = on }
  }
}
"""


class WarmUp(SkillHooks):
    """Hooks start the function, and say how it ended; all else is the managers'."""

    def __init__(self, world: LocalWorld) -> None:
        self._world = world

    def on_dispatch(self, execution: Execution) -> None:
        """Start to warm up."""
        self._world.clock.after(execution.inputs.seconds, lambda: execution.terminate("LIT"))


world = LocalWorld()
world.serve(parse_skillset(MODEL), {"warm_up": WarmUp(world)})
light = world.client("light")
light.wait_ready(1.0)

begun_s = world.now_s
handle = light.start("warm_up", seconds=3.0)
handle.wait(10.0)
print(handle.outcome, handle.result, f"after {world.now_s - begun_s:.1f} s")
print("lamp is", light.resources["lamp"])
