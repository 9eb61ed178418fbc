"""`./alula check --play N FILE...`: play the Nth counterexample of `check` in running managers, in virtual time.

Exit code 0: the managers do what the counterexample says; 1: they do something else; 2: there is no such counterexample.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from alula.cli.check import counterexamples_of
from alula.cli.check_missions import SUFFIX
from alula.cli.play_mission import play_mission
from alula.language.models import check_files, models_in
from alula.prove.limits import DEFAULT_TIME_S
from alula.runtime.counterexample_play import PlayedStep, play


def main(arguments: Sequence[str] | None = None) -> int:
    """Play a counterexample; return the exit code."""
    options = _parser().parse_args(arguments)
    if any(one.endswith(SUFFIX) for one in options.files):
        return play_mission(options)
    paths = dict.fromkeys(path for given in options.files for path in models_in(given))
    files = check_files(list(paths), sys.stdin.buffer)
    counterexamples = counterexamples_of(files, options.time, closed_world=options.closed_world)
    if not 1 <= options.play <= len(counterexamples):
        sys.stderr.write(f"alula check: there is no counterexample {options.play}; these models have {len(counterexamples) or 'none'}\n")
        return 2
    skillset, finding = counterexamples[options.play - 1]
    played = play(skillset, finding.counterexample)
    agrees = not played[-1].differences
    title = f"{finding.span}: {finding.code}: {finding.message}"
    sys.stdout.write(_as_json(title, played, agrees=agrees) if options.json else _as_text(title, played, agrees=agrees))
    return 0 if agrees else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="alula check --play", description="Play a counterexample of the proofs in running managers.")
    parser.add_argument("files", nargs="+", metavar="FILE", help="models, as for `alula check`")
    parser.add_argument(
        "--play", type=int, required=True, metavar="N", help="the number of the counterexample in the output of `alula check`"
    )
    parser.add_argument(
        "--time", type=float, default=DEFAULT_TIME_S, metavar="SECONDS", help="time limit for the proofs of a file (default 30)"
    )
    parser.add_argument("--closed-world", action="store_true", help="as for `alula check`")
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="of a mission: folder for the run's files (default: runs/TIME-NAME of the robot)"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    return parser


def _as_text(title: str, played: Sequence[PlayedStep], *, agrees: bool) -> str:
    lines = [title]
    for number, one in enumerate(played, 1):
        lines.append(f"  {number}. {one.step.text}")
        lines += [f"       but {difference}" for difference in one.differences]
    lines.append("the managers do the same" if agrees else "the managers do something else")
    return "\n".join(lines) + "\n"


def _as_json(title: str, played: Sequence[PlayedStep], *, agrees: bool) -> str:
    steps = [{**one.step.as_json(), "differences": list(one.differences)} for one in played]
    return json.dumps({"finding": title, "agrees": agrees, "steps": steps}, indent=2) + "\n"


if __name__ == "__main__":
    sys.exit(main())
