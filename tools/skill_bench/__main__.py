"""Measure what the skill layer costs compared with bare rclpy: ``./alula bench skills``.

Managers in one process, their client in another; in the same run and by turns a bare action and a bare topic between two further
processes. Times are median / 95th percentile in milliseconds.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from types import FrameType

from skill_bench.cases import CASES
from skill_bench.figures import as_json, table, verdicts
from skill_bench.processes import BenchError

EXIT_OK, EXIT_FAILED, EXIT_USAGE, EXIT_INTERRUPTED = 0, 1, 2, 130


def parse_arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Return the command line's values; wrong ones print the usage on stderr and exit with code 2."""
    parser = argparse.ArgumentParser(prog="alula bench skills", description="Measures what the skill layer costs compared with bare rclpy.")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures to this file")
    parser.add_argument("--quick", action="store_true", help="fewer measurements: for a first look, not for comparing")
    names = [case.name for case in CASES]
    parser.add_argument(
        "--case", action="append", choices=names, metavar="NAME", help=f"measure only this case; repeatable; one of {', '.join(names)}"
    )
    return parser.parse_args(arguments)


def run(options: argparse.Namespace) -> str:
    """Measure, write the file, and return the table."""
    from skill_bench.run import FULL, QUICK, open_bench

    effort = QUICK if options.quick else FULL
    begin_s = time.monotonic()
    with open_bench(lambda text: _say(f"[{time.monotonic() - begin_s:4.0f} s] {text}")) as bench:
        cases = [bench.measure(case, effort) for case in CASES if not options.case or case.name in options.case]
        bare = bench.idle(effort)
    if options.json is not None:
        options.json.write_text(json.dumps(as_json(cases, bare), indent=1) + "\n", encoding="utf-8")
    beside = f"The bare action's server beside them: {bare.rss_mb:.0f} MB, idle {bare.idle_percent:.1f} %."
    return "\n".join([table(cases), "", beside, *verdicts(cases)]) + "\n"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the benchmark; return the exit code."""
    options = parse_arguments(arguments)
    # SIGTERM unwinds the blocks in which the other processes run, which end with them.
    signal.signal(signal.SIGTERM, _end)
    try:
        sys.stdout.write(run(options))
    except KeyboardInterrupt:
        _say("alula bench skills: interrupted")
        return EXIT_INTERRUPTED
    except ImportError as error:
        _say(f"alula bench skills: {error}; run it by ./alula bench skills, after ./alula setup")
        return EXIT_USAGE
    except BenchError as error:
        _say(f"alula bench skills: {error}")
        return EXIT_FAILED
    return EXIT_OK


def _end(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
    raise KeyboardInterrupt


def _say(text: str) -> None:
    sys.stderr.write(text + "\n")


if __name__ == "__main__":
    sys.exit(main())
