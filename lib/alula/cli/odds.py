"""``alula odds MISSION.xml``: how likely it is accomplished, degraded, given up in order, or neither.

Ends with 0, and with 2 when a file can't be read or is wrong, or there is no Storm.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from alula.cli.saying import warner
from alula.cli.table import parse
from alula.common.files import json_line, write_text
from alula.common.robots import RobotError
from alula.common.scenarios import ScenarioError
from alula.missions.plan import InputError
from alula.odds.errors import OddsError
from alula.odds.odds import changed, odds_of
from alula.odds.rendering import as_dict, as_svg, as_text
from alula.odds.robot import graph_of
from alula.prove.mission.oracle import UndecidedError
from alula.records.errors import AnalysisError
from alula.runtime.core.errors import SkillRuntimeError
from alula.trees.errors import TreeError

COMMAND = "alula odds"
WRONG = 2


def main(words: Sequence[str] | None = None) -> int:
    """Tell the odds; return the exit code."""
    given = parse("odds", words)
    try:
        return run(given)
    except (
        OddsError,
        AnalysisError,
        RobotError,
        ScenarioError,
        InputError,
        UndecidedError,
        SkillRuntimeError,
        TreeError,
        OSError,
    ) as error:
        sys.stderr.write(f"{COMMAND}: {error}\n")
        return WRONG


def run(given: argparse.Namespace) -> int:
    """Do what is asked for; raises what ``main`` tells."""
    if given.most < 1:
        raise OddsError(f"--most {given.most}: is a number of situations, from 1 on")
    graph, figures = graph_of(given.file, given.world, most=given.most, unlikely=given.unlikely, on_progress=_tell, warn=warner(COMMAND))
    changes = {text: changed(figures, text, graph) for text in given.changes}
    found = odds_of(graph, figures)
    others = {text: odds_of(graph, other, costs=False) for text, other in changes.items()}
    title = f"{given.file.name}: odds"
    if given.svg is not None:
        write_text(given.svg, as_svg(title, found))
    sys.stdout.write(json_line(as_dict(found, others)) if given.json else as_text(title, found, others))
    return 0


def _tell(found: int, looked: int) -> None:
    sys.stderr.write(f"{COMMAND}: {looked} of {found} situations looked at\n")


if __name__ == "__main__":
    sys.exit(main())
