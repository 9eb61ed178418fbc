"""Sets planners beside `alula plan`: `setup/in_ros2 python -m planners_table VENV [--case dock] [--keep DIR]`.

``VENV`` is an environment with `requirements.txt` of this folder installed: ``python3 -m venv VENV`` and
``VENV/bin/pip install -r tools/planners_table/requirements.txt``. A line of the table is a planner, and a notation of the case:

- *seconds* of the processor for the first plan, of the planner alone; *answer*: the plan's actions.
- *other ends*: how many of the other results that the plan's skills have, and *broken*: how many of the states that break what has to hold
  in one of its steps, it finds a plan after, asked again from there, as PlanSys2 and SkiROS2 do; *same*: how many of these plans are the
  rest of the one that failed. `alula plan` answers before the start: its line counts the robot's faults that its tree survives.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from alula.common.robots import load_robot_folder, meaning
from alula.model.expressions import Expression
from alula.prove.limits import Deadline
from alula.repair.courses import Here
from alula.repair.planning import EMPTY, Aim, Planner
from alula.repair.purposes import Purposes
from alula.repair.repairing import condition_of
from alula.repair.subject import Subject
from growing_bench import Row, tell_rows
from planners_table.cases import CASES, Case, beginning, otherwise
from planners_table.pddl import CLASSICAL, RESULTS, TEMPORAL, Models, names

ROBOT = Path(__file__).resolve().parents[2] / "examples/rover"
HERE = Path(__file__).resolve().parent
LIMIT_S = 60.0
PLANNERS = (("pyperplan", CLASSICAL), ("fast-downward", CLASSICAL), ("fast-downward", RESULTS), ("tamer", TEMPORAL), ("kairos", TEMPORAL))
"""Kairos is what PlanSys2 4.0 plans with by default; of results, a determinization is solved: which one comes is the planner's choice."""
COLUMNS = "{planner:<14} {notation:<10} {seconds:>8}  {ends:>10} {broken:>8} {same:>5}  {answer}"


@dataclass(frozen=True)
class Asked:
    """One planner, and the case.

    Attributes:
        python: of the planners' environment.
        folder: where the PDDL is written.
    """

    python: Path
    folder: Path
    models: Models
    planner: str
    notation: str
    goal: str | Expression

    def plan(self, here: Here) -> dict[str, Any]:
        """Return what it answers from a situation."""
        text = self.models.text(self.notation, here, self.goal)
        domain, problem = self.folder / f"{self.notation}.pddl", self.folder / f"{self.notation}-problem.pddl"
        domain.write_text(text.domain, encoding="utf-8")
        problem.write_text(text.problem, encoding="utf-8")
        if self.notation == RESULTS:
            domain = self._determinized(domain)
        words = [self.python, HERE / "solve.py", self.planner, domain, problem, str(LIMIT_S)]
        try:
            done = subprocess.run(list(map(str, words)), capture_output=True, text=True, timeout=2 * LIMIT_S, check=False)
            found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
        except subprocess.TimeoutExpired:
            found = {"status": f"nothing in {2 * LIMIT_S:g} s", "steps": [], "seconds": 2 * LIMIT_S}
        except (ValueError, IndexError):
            found = {"status": f"ended with {done.returncode}", "steps": [], "seconds": 0.0}
        return found

    def row(self, here: Here) -> Row:
        """Return its line of the table."""
        first = self.plan(here)
        known = names(self.models.purposes)
        steps = [known[_bare(one)] for one in first["steps"] if not one.startswith("end-")]
        counts = {True: [0, 0], False: [0, 0]}
        same = 0
        for one in otherwise(steps, here, self.models.purposes):
            again = self.plan(one.here)["steps"]
            counts[one.is_result][0] += bool(again)
            counts[one.is_result][1] += 1
            same += bool(again) and first["steps"][-len(again) :] == again
        return {
            "planner": self.planner,
            "notation": self.notation,
            "seconds": f"{first['seconds']:.3f}",
            "ends": "{} of {}".format(*counts[True]),
            "broken": "{} of {}".format(*counts[False]),
            "same": same,
            "answer": ", ".join(first["steps"]) or first["status"],
        }

    def _determinized(self, domain: Path) -> Path:
        out = domain.with_name("determinized.pddl")
        words = [self.python.with_name("fond-utils"), "determinize", "--input", domain, "--output", out]
        subprocess.run(list(map(str, words)), check=True, capture_output=True)
        return out


def _bare(action: str) -> str:
    """Return an action's name without the number of its outcome, which a determinization adds."""
    return action.partition("_detdup_")[0]


def planned(case: Case) -> Row:
    """Return the line of `alula plan`."""
    begun_s = time.process_time()
    plan = Planner(Aim(case.goal, case.start), Deadline.after(10 * LIMIT_S), _quiet).run().plan
    seconds = time.process_time() - begun_s
    survived = [] if plan is None else [fate.survives for fate in plan.fates.values()]
    return {
        "planner": "alula plan",
        "notation": "models",
        "seconds": f"{seconds:.3f}",
        "ends": f"{sum(survived)} of {len(survived)}",
        "broken": "faults",
        "same": "",
        "answer": "none" if plan is None else f"{', '.join(plan.steps)}; {plan.nodes} nodes, proved",
    }


def main(words: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="planners_table", description="Set planners beside `alula plan`.")
    parser.add_argument("venv", type=Path, metavar="VENV", help="an environment with the planners")
    parser.add_argument("--case", choices=CASES, default="dock", help="what is asked for (default dock)")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="keep the PDDL in this folder")
    given = parser.parse_args(words)
    case = CASES[given.case]
    with tempfile.TemporaryDirectory() as folder, meaning(load_robot_folder(ROBOT)):
        tell_rows(COLUMNS, _rows(case, given.venv / "bin/python", given.keep or Path(folder)))
    return 0


def _rows(case: Case, python: Path, folder: Path) -> Iterator[Row]:
    folder.mkdir(parents=True, exist_ok=True)
    mission = folder / "none.xml"
    mission.write_text(EMPTY, encoding="utf-8")
    subject = Subject.read(mission, _quiet)
    models = Models(Purposes(subject.skillsets, subject.brought))
    goal = case.goal if case.goal.isidentifier() else condition_of("--goal", case.goal)
    here = beginning(case, subject)
    for planner, notation in PLANNERS:
        yield Asked(python, folder, models, planner, notation, goal).row(here)
    yield planned(case)
    sys.stderr.write("".join(f"not said in PDDL: {one}\n" for one in sorted(models.left_out)))


def _quiet(_line: str) -> None:
    """Take no notice of progress."""


if __name__ == "__main__":
    sys.exit(main())
