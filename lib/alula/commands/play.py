"""`./alula check --play N FILE...`: play the Nth story that `check` tells in running managers, in virtual time.

Ends with 0 when the managers come to the story's end, 1 when they come out otherwise, 2 when there is no such story.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence

from alula.commands.check import stories_of
from alula.language.models import check_files, models_in
from alula.prove.limits import DEFAULT_TIME_S
from alula.runtime.story_play import PlayedStep, play


def main(arguments: Sequence[str] | None = None) -> int:
    """Play a story; return the exit code."""
    options = _parser().parse_args(arguments)
    paths = dict.fromkeys(path for given in options.files for path in models_in(given))
    files = check_files(list(paths), sys.stdin.buffer)
    stories = stories_of(files, options.time, closed_world=options.closed_world)
    if not 1 <= options.play <= len(stories):
        sys.stderr.write(f"alula check: there is no story {options.play}; these models have {len(stories) or 'none'}\n")
        return 2
    skillset, finding = stories[options.play - 1]
    played = play(skillset, finding.story)
    agrees = not played[-1].differences
    title = f"{finding.span}: {finding.code}: {finding.message}"
    sys.stdout.write(_as_json(title, played, agrees=agrees) if options.json else _as_text(title, played, agrees=agrees))
    return 0 if agrees else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="alula check --play", description="Play a story of the proofs in running managers.")
    parser.add_argument("files", nargs="+", metavar="FILE", help="models, as for `alula check`")
    parser.add_argument("--play", type=int, required=True, metavar="N", help="the story with this number in what `alula check` prints")
    parser.add_argument("--time", type=float, default=DEFAULT_TIME_S, metavar="SECONDS", help="how long the proofs of a file may take")
    parser.add_argument("--closed-world", action="store_true", help="as for `alula check`")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    return parser


def _as_text(title: str, played: Sequence[PlayedStep], *, agrees: bool) -> str:
    lines = [title]
    for number, one in enumerate(played, 1):
        lines.append(f"  {number}. {one.step.text}")
        lines += [f"       but {difference}" for difference in one.differences]
    lines.append("the managers come to the same end" if agrees else "the managers come out otherwise")
    return "\n".join(lines) + "\n"


def _as_json(title: str, played: Sequence[PlayedStep], *, agrees: bool) -> str:
    steps = [{**one.step.as_json(), "differences": list(one.differences)} for one in played]
    return json.dumps({"finding": title, "agrees": agrees, "steps": steps}, indent=2) + "\n"


if __name__ == "__main__":
    sys.exit(main())
