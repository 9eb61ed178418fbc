"""``alula repair MISSION.xml --fault F | --finding N``: write the fallback branch that a mission lacks, and prove it.

Ends with 0 when a branch was proved, or none is needed; 1: it is impossible, or none was found; 2: it can't be asked so.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from alula.cli.ctrl_c import ctrl_c_stops
from alula.cli.saying import warner
from alula.cli.table import parse
from alula.common.errors import AlulaError
from alula.common.files import check_place, json_line, write_text
from alula.common.garbage import collect_seldom
from alula.missions.drawing import draw
from alula.odds.errors import OddsError
from alula.odds.odds import Odds, odds_of
from alula.odds.robot import graph_of
from alula.prove.limits import Deadline, OutOfTimeError
from alula.repair.branches import Branch
from alula.repair.rendering import added, as_dict, as_text
from alula.repair.repairing import Question, Search
from alula.repair.subject import Subject
from alula.trees.answers import Answers, StepClock, scripted_tree
from alula.trees.view import view_of

COMMAND = "alula repair"
NONE, WRONG = 1, 2


def main(words: Sequence[str] | None = None) -> int:
    """Search; return the exit code."""
    given = parse("repair", words)
    collect_seldom()
    try:
        return run(given)
    except OutOfTimeError:
        sys.stderr.write(f"{COMMAND}: the mission as it is can't be looked at in the time that it had; allow more with `--time`\n")
        return WRONG
    except (AlulaError, OSError) as error:
        sys.stderr.write(f"{COMMAND}: {error}\n")
        return WRONG


def run(given: argparse.Namespace) -> int:
    """Do what is asked for; raises what ``main`` tells."""
    check_place("--out", given.out)
    check_place("--svg", given.svg)
    tell = warner(COMMAND)
    subject = Subject.read(given.file, tell)
    using = tuple(one.strip() for part in given.using for one in part.split(",") if one.strip())
    question = Question(given.fault, given.finding, given.within, using, given.most_faults, given.goal, given.never)
    search = Search(subject, question, Deadline.after(given.time, tell), tell)
    with ctrl_c_stops(search.stop):
        answer = search.run()
    repair = answer.repair
    odds = None
    if repair is not None:
        with subject.copy(repair.text) as changed:
            odds = _odds(subject.flown_as, given.file, changed)
            if given.svg is not None:
                write_text(given.svg, _drawn(subject, repair.branch, changed))
                tell(f"{given.svg} shows it")
    if repair is not None and given.out is not None:
        write_text(given.out, repair.text)
        tell(f"{given.out} has it")
    sys.stdout.write(json_line(as_dict(answer, odds)) if given.json else as_text(answer, odds))
    return 0 if repair is not None or answer.survives_already else NONE


def _drawn(subject: Subject, branch: Branch, changed: Path) -> str:
    """Return a drawing of the mission with the branch."""
    mission = subject.changed(changed)
    tree = scripted_tree(mission.files, mission.registry, Answers({}), StepClock())
    view = view_of(tree.root)
    return draw(view, f"{subject.path.name}: {mission.files.main}, with '{branch.name}'", added(view, branch))


def _odds(path: Path, before: Path, changed: Path) -> tuple[Odds, Odds] | None:
    """Return them without and with the branch; None where there is no Storm, or the robot has no figures to compute with."""
    try:
        found = [_odds_of(path, one) for one in (before, changed)]
    except OddsError as error:
        sys.stderr.write(f"{COMMAND}: no odds: {error}\n")
        return None
    return found[0], found[1]


def _odds_of(path: Path, changed: Path) -> Odds:
    graph, figures = graph_of(path, changed=changed, most=MOST, unlikely=UNLIKELY)
    return odds_of(graph, figures, costs=False)


MOST, UNLIKELY = 3_000, 1e-4

if __name__ == "__main__":
    sys.exit(main())
