"""Prints what `check`, or a campaign, makes of altered missions: ``setup/in_ros2 python -m mission_mutations [--count N] [--seed N]``."""

from __future__ import annotations

import argparse
import sys
import traceback
from collections.abc import Iterator, Sequence
from functools import cache, partial
from pathlib import Path

from alula.campaign.plan import load_campaign
from alula.check.robot import models_of, part_of
from alula.common.robots import find_robot
from alula.language.messages import messages_of
from alula.records.causes.fault_file import states_of_faults
from alula.trees.reading import read_files
from mission_mutations.flights import Campaigned, Flights
from mission_mutations.judging import MISSED, Judge, Robot, Verdict
from mission_mutations.mutants import Mutant, chosen, mutants_of
from mission_mutations.rendering import by_what, table, table_of_flights
from mission_mutations.study import Study

COMMAND = "mission_mutations"
MAIN = "main_tree_to_execute="


def warn(line: str) -> None:
    """Write a line to the standard error."""
    sys.stderr.write(f"{COMMAND}: {line}\n")


@cache
def robot_of(root: Path) -> Robot:
    """Return a robot with what its missions are made of."""
    robot = find_robot(root)
    models = models_of(robot, warn)
    return Robot(robot.root / "missions", models, part_of(robot, warn), states_of_faults(models, warn), messages_of(robot))


@cache
def judge_of(root: Path, mission: str) -> Judge:
    """Return the judge of a mission, made once in each process."""
    return Judge(robot_of(root), mission)


@cache
def flights_of(root: Path, file: Path, mission: str) -> Flights:
    """Return the flights of a campaign's file that are of a mission, made once in each process; raises AnalysisError."""
    return Flights(robot_of(root), mission, load_campaign(file))


def judged(root: Path, mutant: Mutant) -> Verdict:
    """Judge one mutant, in any process; a search that raises finds nothing."""
    try:
        return judge_of(root, mutant.mission).judge(mutant)
    except Exception as error:  # noqa: BLE001 - whatever it is, the study tells it and goes on
        told = traceback.format_exception(error)[-2:]
        return Verdict(mutant.mission, mutant.kind, mutant.what, MISSED, type(error).__name__, "".join(told), flown=None, cpu_s=0.0)


def mutants(root: Path, missions: Sequence[str]) -> Iterator[Mutant]:
    """Yield all mutants of some of a robot's missions, all of them where none is named."""
    robot = robot_of(root)
    paths = [path for path in sorted(robot.folder.glob("*.xml")) if MAIN in path.read_text(encoding="utf-8")]
    for path in paths:
        if not missions or path.stem in missions:
            parts = [Path(document.path) for document in read_files(path).documents]
            text = "".join(path.read_text(encoding="utf-8") for path in parts)
            used = {one.name: [skill.name for skill in one.skills if f"<{one.name}.{skill.name}" in text] for one in robot.skillsets}
            yield from mutants_of(path, parts, robot.skillsets, used, robot.part)


def flown(root: Path, file: Path, mutant: Mutant) -> Campaigned:
    """Fly one mutant by a campaign's file, in any process."""
    return flights_of(root, file, mutant.mission).judge(mutant)


def main(arguments: Sequence[str] | None = None) -> int:
    """Judge, print, and end with 1 where a mutant was missed."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="Alter a robot's missions and models, and look what `check` finds.")
    parser.add_argument("missions", nargs="*", metavar="MISSION", help="names of missions (default: all of the robot's)")
    parser.add_argument("--count", type=int, default=300, help="so many mutants, of each kind alike (default 300)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=1, help="at once (default 1)")
    parser.add_argument(
        "--campaign", type=Path, metavar="FILE", help="fly them as this campaign over mocks instead, and look what that finds"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write each mutant to this file; what it has is not judged again")
    given = parser.parse_args(arguments)
    root = find_robot().root
    everything = list(mutants(root, given.missions))
    some = chosen(everything, given.count, given.seed)
    sys.stderr.write(f"{len(some)} of {len(everything)} mutants\n")
    if given.campaign is not None:
        by_flights = Study(partial(flown, root, given.campaign), Campaigned, given.json, given.seed).run(some, given.processes)
        sys.stdout.write(f"{table_of_flights(by_flights)}\n")
        return 0
    verdicts = Study(partial(judged, root), Verdict, given.json, given.seed).run(some, given.processes)
    sys.stdout.write(f"{table(verdicts)}\n\n{by_what(verdicts)}\n")
    return 1 if any(one.verdict == MISSED for one in verdicts) else 0


if __name__ == "__main__":
    sys.exit(main())
