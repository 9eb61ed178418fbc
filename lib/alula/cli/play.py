"""`./alula check --play N FILE...`: play the Nth counterexample of `check` in running managers, in virtual time.

Exit code 0: the managers do what the counterexample says; 1: they do something else; 2: there is no such counterexample.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from alula.api.checking import counterexamples_of, is_mission
from alula.cli.play_mission import play_mission
from alula.cli.saying import warner
from alula.common.files import json_line
from alula.language.models import check_files, models_in
from alula.prove.skillset.play import PlayedStep, play


def run(options: argparse.Namespace, enums: Mapping[str, float]) -> int:
    """Play the counterexample that ``alula check --play`` is asked for; return the exit code."""
    if not options.files:
        sys.stderr.write("alula check: --play needs the models or missions whose counterexample is meant\n")
        return 2
    if any(map(_has_trees, options.files)):
        return play_mission(options, enums)
    paths = dict.fromkeys(path for given in options.files for path in models_in(given))
    files = check_files(list(paths), sys.stdin.buffer)
    counterexamples = counterexamples_of(files, options.time, closed_world=options.closed_world, on_progress=warner("alula check"))
    if not 1 <= options.play <= len(counterexamples):
        sys.stderr.write(f"alula check: there is no counterexample {options.play}; these models have {len(counterexamples) or 'none'}\n")
        return 2
    skillset, finding = counterexamples[options.play - 1]
    played = play(skillset, finding.counterexample)
    agrees = not played[-1].differences
    title = f"{finding.span}: {finding.code}: {finding.message}"
    sys.stdout.write(_as_json(title, played, agrees=agrees) if options.json else _as_text(title, played, agrees=agrees))
    return 0 if agrees else 1


def _has_trees(place: str) -> bool:
    """Return whether missions are meant: a file of one, or a folder that has no models."""
    return is_mission(place) or (Path(place).is_dir() and models_in(place) == [place])


def _as_text(title: str, played: Sequence[PlayedStep], *, agrees: bool) -> str:
    lines = [title]
    for number, one in enumerate(played, 1):
        lines.append(f"  {number}. {one.step.text}")
        lines += [f"       but {difference}" for difference in one.differences]
    lines.append("the managers do the same" if agrees else "the managers do something else")
    return "\n".join(lines) + "\n"


def _as_json(title: str, played: Sequence[PlayedStep], *, agrees: bool) -> str:
    steps = [{**one.step.as_json(), "differences": list(one.differences)} for one in played]
    return json_line({"finding": title, "agrees": agrees, "steps": steps})
