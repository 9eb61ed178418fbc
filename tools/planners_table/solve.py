"""Asks one planner for one plan; runs in the environment of the planners, which has nothing of Alula.

``python solve.py PLANNER DOMAIN PROBLEM SECONDS`` prints a JSON object: status, steps (the actions in order, of a temporal plan by the
times at which they start), seconds of the processor.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
from typing import Any


def main(name: str, domain: str, problem: str, limit_s: float) -> dict[str, Any]:
    """Solve; return the object that is printed."""
    shortcuts = importlib.import_module("unified_planning.shortcuts")
    reader = importlib.import_module("unified_planning.io").PDDLReader()
    shortcuts.get_environment().credits_stream = None
    if name == "kairos":
        importlib.import_module("up_kairos").register()
    task = reader.parse_problem(domain, problem)
    begun_s = worked_s()
    try:
        with shortcuts.OneshotPlanner(name=name) as planner:
            if not planner.supports(task.kind):
                return {"status": "can't be said to it", "steps": [], "seconds": 0.0}
            found = planner.solve(task, timeout=None if name in {"pyperplan", "tamer"} else limit_s)
    except Exception as error:  # noqa: BLE001 - whatever a planner does is told
        return {"status": f"{type(error).__name__}: {error}"[:120], "steps": [], "seconds": worked_s() - begun_s}
    seconds = worked_s() - begun_s
    return {"status": found.status.name, "steps": steps(found.plan), "seconds": seconds}


def worked_s() -> float:
    """Return the processor's seconds that this process has had, and those that it has started and that have ended."""
    return sum(os.times()[:4])


def steps(plan: Any) -> list[str]:
    """Return the names of a plan's actions."""
    if plan is None:
        return []
    timed = getattr(plan, "timed_actions", None)
    if timed is not None:
        return [one.action.name for _, one, _ in sorted(timed, key=lambda each: each[0])]
    return [one.action.name for one in plan.actions]


if __name__ == "__main__":
    PLANNER, DOMAIN, PROBLEM, LIMIT_S = sys.argv[1:]
    print(json.dumps(main(PLANNER, DOMAIN, PROBLEM, float(LIMIT_S))))  # noqa: T201 - that is what it is for
