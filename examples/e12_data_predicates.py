"""Conditions over data: a precondition and an invariant ask for a battery's level; without a fresh value nothing holds.

It prints:

    no value: NOT_READY charged: battery has no fresh value
    40 %: NOT_READY charged
    falls to 10 % for a second: RUNNING
    falls to 10 %: RESOURCE_INVARIANT_VIOLATED enough
"""

from __future__ import annotations

from types import SimpleNamespace

from alula import LocalWorld, SkillHooks, parse_skillset

MODEL = """
skillset power {
  type Battery
  data battery: Battery period = 1.0
  skill work {
    precondition { charged: data = (battery.level > 50 %) }
    invariant { enough: data = (battery.level > 20 %) for 2 s }
    result { DONE }
  }
}
"""

world = LocalWorld()
managers = world.serve(parse_skillset(MODEL), {"work": SkillHooks()})
power = world.client("power")
power.wait_ready(1.0)


def work(*levels: float) -> str:
    """Have it work while the battery's driver tells a level a second; return how it ended."""
    managers.publish("battery", SimpleNamespace(level=levels[0]))
    world.run_for(0.1)
    handle = power.start("work")
    for level in levels[1:]:
        world.run_for(1.0)
        managers.publish("battery", SimpleNamespace(level=level))
    world.run_for(1.0)
    return f"{handle.outcome or 'RUNNING'} {handle.result}".strip()


silent = power.start("work")
silent.wait(1.0)
print("no value:", silent.outcome, silent.message)
print("40 %:", work(0.4))
print("falls to 10 % for a second:", work(0.6, 0.1, 0.6))
print("falls to 10 %:", work(0.6, 0.1, 0.1, 0.1))
