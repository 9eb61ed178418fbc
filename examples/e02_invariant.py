"""An invariant: what has to stay true while a skill runs. It ends the skill in the step in which it breaks; nothing polls it.

It prints:

    RESOURCE_INVARIANT_VIOLATED way_stays_clear
    wheels are FREE, the motor was stopped: True
    then: NOT_READY way_is_clear
"""

from __future__ import annotations

from alula import Execution, LocalWorld, SkillHooks, parse_skillset

MODEL = """
skillset base {
  resource wheels { initial FREE  FREE -> USED  USED -> FREE }
  resource bumper { initial CLEAR  extern CLEAR -> PRESSED  extern PRESSED -> CLEAR }
  skill drive {
    effect { take: wheels -> USED  release: wheels -> FREE }
    precondition {
      way_is_clear: resource = (bumper == CLEAR)
      success take
    }
    invariant { way_stays_clear: resource = (bumper == CLEAR) violation = release }
    interrupt { apply = release }
    result { ARRIVED: apply = release }
  }
}
"""


class Drive(SkillHooks):
    """Drives until it is stopped."""

    stopped = False

    def on_violation(self, _execution: Execution) -> None:
        """Stop the motor; the execution has ended already."""
        self.stopped = True


drive = Drive()
world = LocalWorld()
world.serve(parse_skillset(MODEL), {"drive": drive})
base = world.client("base")
base.wait_ready(1.0)

handle = base.start("drive")
world.run_for(2.0)
base.transition("bumper", "PRESSED")  # as the bumper's driver does
handle.wait(1.0)
world.run_for(0.1)
print(handle.outcome, handle.result)
print(f"wheels are {base.resources['wheels']}, the motor was stopped: {drive.stopped}")

again = base.start("drive")
again.wait(1.0)
print("then:", again.outcome, again.result)
