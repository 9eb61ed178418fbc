"""``alula plan [SKILLSETS] --goal C``: write a mission that reaches a goal, from nothing, and prove it.

Ends with 0 when one was proved; 1: it is impossible, or none was found; 2: it can't be asked so.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from alula.cli.ctrl_c import ctrl_c_stops
from alula.cli.saying import warner
from alula.cli.table import parse
from alula.common.errors import AlulaError
from alula.common.files import check_place, json_line, write_text
from alula.common.garbage import collect_seldom
from alula.common.robots import find_robot, meaning
from alula.prove.limits import Deadline
from alula.repair.errors import RepairError
from alula.repair.planning import Aim, Planner
from alula.repair.rendering import plan_as_dict, plan_as_text

COMMAND = "alula plan"
NONE, WRONG = 1, 2


def main(words: Sequence[str] | None = None) -> int:
    """Search; return the exit code."""
    given = parse("plan", words)
    collect_seldom()
    try:
        with meaning(None if given.skillsets is None else find_robot(given.skillsets)):
            return run(given)
    except (AlulaError, OSError) as error:
        sys.stderr.write(f"{COMMAND}: {error}\n")
        return WRONG


def run(given: argparse.Namespace) -> int:
    """Do what is asked for; raises what ``main`` tells."""
    if not given.goal:
        raise RepairError("name what is to be reached: --goal CONDITION, such as skillset.resource == STATE, or a role of a skill")
    check_place("--out", given.out)
    tell = warner(COMMAND)
    using = tuple(one.strip() for part in given.using for one in part.split(",") if one.strip())
    aim = Aim(given.goal, given.start, given.never, using, given.most_faults)
    planner = Planner(aim, Deadline.after(given.time, tell), tell)
    with ctrl_c_stops(planner.stop):
        answer = planner.run()
    if answer.plan is not None and given.out is not None:
        write_text(given.out, answer.plan.text)
        tell(f"{given.out} has it")
    sys.stdout.write(json_line(plan_as_dict(answer)) if given.json else plan_as_text(answer))
    return 0 if answer.plan is not None else NONE


if __name__ == "__main__":
    sys.exit(main())
