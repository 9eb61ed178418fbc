"""`./alula bench repair [--json FILE] [--case NAME]... [--timeout 60]`: what `alula repair` costs, and how that grows.

Repairs the robots' missions without a branch that they have by hand, and robots of four kinds that grow (`cases`), each in a process of
its own: seconds of the processor, peak memory, how many branches were judged, and the answer. A line is printed as soon as it is measured;
a kind that is not through in the time is not tried with more.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from alula.common.garbage import collect_seldom
from alula.common.robots import load_robot_folder, meaning
from alula.prove.limits import Deadline, OutOfTimeError
from alula.repair.repairing import Question, Search
from alula.repair.subject import Subject
from growing_bench import Row, measured_apart, peak_mb, tell_row, tell_rows, write_rows
from repair_bench.cases import FAMILIES, ROBOTS, Case, growing

COMMAND = "alula bench repair"
COLUMNS = "{case:<15}{size:>5}{seconds:>9}{cpu_s:>9}{peak_mb:>9}{tried:>7}{nodes:>7}  {answer}"
ROOT = Path(__file__).resolve().parents[2]


def measure(name: str, size: int, timeout_s: float) -> Row:
    """Repair one mission in this process; ``size`` is nothing for a robot's own."""
    collect_seldom()
    with tempfile.TemporaryDirectory() as folder:
        case = ROBOTS[name](ROOT, Path(folder)) if name in ROBOTS else growing(name, size, Path(folder))
        begun_s, worked_s = time.monotonic(), time.process_time()
        answer, tried, nodes = _answered(case, timeout_s)
        return {
            "case": name,
            "size": size,
            "seconds": round(time.monotonic() - begun_s, 2),
            "cpu_s": round(time.process_time() - worked_s, 2),
            "peak_mb": peak_mb(),
            "tried": tried,
            "nodes": nodes,
            "answer": answer,
        }


def _answered(case: Case, timeout_s: float) -> tuple[str, int, int]:
    """Return the answer, how many branches were tried for it, and the nodes of the one that was proved."""
    with meaning(load_robot_folder(case.robot)):
        try:
            found = Search(Subject.read(case.mission, _quiet), Question(case.fault), Deadline.after(timeout_s), _quiet).run()
        except OutOfTimeError:
            return "not in the time", 0, 0
    if found.repair is not None:
        return "repaired", found.tried, found.repair.branch.size
    return "impossible" if found.impossible else "not in the time" if found.stopped else "unknown", found.tried, 0


def _quiet(_line: str) -> None:
    """Take no notice of progress."""


def main(words: Sequence[str] | None = None) -> int:
    """Measure all; print a table, and write JSON where it is wanted."""
    options = _parser().parse_args(words)
    if options.one:
        name, size = options.one
        return tell_row(measure(name, int(size), options.timeout))
    rows = tell_rows(COLUMNS, _all(options.case or [*ROBOTS, *FAMILIES], options.timeout))
    write_rows(options.json, "repairs", rows, timeout_s=options.timeout)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=COMMAND, description="Measure what a repair costs, and how that grows.")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures to this file")
    names = [*ROBOTS, *FAMILIES]
    parser.add_argument("--case", action="append", default=[], choices=names, metavar="NAME", help=f"only these: {'; '.join(names)}")
    parser.add_argument("--timeout", type=float, default=60.0, metavar="SECONDS", help="time limit of each (default 60)")
    parser.add_argument("--one", nargs=2, metavar=("CASE", "SIZE"), help="measure only this one, in this process")
    return parser


def _all(names: Sequence[str], timeout_s: float) -> Iterator[Row]:
    for name in names:
        for size in FAMILIES[name][1] if name in FAMILIES else (0,):
            row = measured_apart("repair_bench", "--timeout", str(timeout_s), "--one", name, str(size))
            yield row
            if row["answer"] == "not in the time":
                break


if __name__ == "__main__":
    sys.exit(main())
