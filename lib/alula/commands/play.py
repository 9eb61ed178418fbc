"""`./alula check --play N FILE...`: play the Nth story that `check` tells in running managers: in virtual time, over rclpy, over rospy.

Ends with 0 when the managers come to the story's end, 1 when they come out otherwise, 2 when there is no such story.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from alula.commands.check import stories_of
from alula.language.models import check_files, models_in
from alula.language.stories import Story
from alula.model.model import Skillset
from alula.prove.limits import DEFAULT_TIME_S
from alula.runtime.live_story import from_line, to_line
from alula.runtime.story_play import PlayedStep, play

VIRTUAL = "virtual"
PLAYERS = {"ros2": "skillset_ros2.story_world", "ros1": "skillset_ros1.story_world"}
"""The program that plays a story over a ROS, in the environment ``setup/in_<name>``."""


class _PlayerError(Exception):
    """A story could not be played."""


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
    try:
        played = _play_over(options.over, skillset, finding.story)
    except _PlayerError as error:
        sys.stderr.write(f"alula check: {error}\n")
        return 2
    agrees = not played[-1].differences
    title = f"{finding.span}: {finding.code}: {finding.message}"
    sys.stdout.write(_as_json(title, played, agrees=agrees) if options.json else _as_text(title, played, agrees=agrees))
    return 0 if agrees else 1


def _play_over(world: str, skillset: Skillset, story: Story) -> list[PlayedStep]:
    """Play a story in managers of a world; raise _PlayerError when they can't be had."""
    if world == VIRTUAL:
        return play(skillset, story)
    command = [str(Path(os.environ["ALULA_ROOT"]) / "setup" / f"in_{world}"), "python", "-m", PLAYERS[world]]
    done = subprocess.run(command, input=to_line(skillset, story), stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        raise _PlayerError(f"the player over {world} ended with {done.returncode}; try --over {VIRTUAL}")
    return from_line(story, done.stdout)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="alula check --play", description="Play a story of the proofs in running managers.")
    parser.add_argument("files", nargs="+", metavar="FILE", help="models, as for `alula check`")
    parser.add_argument("--play", type=int, required=True, metavar="N", help="the story with this number in what `alula check` prints")
    parser.add_argument("--over", choices=[VIRTUAL, *PLAYERS], default=VIRTUAL, help="what the managers run on (default: %(default)s)")
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
