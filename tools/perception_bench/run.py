"""Measure the perception nodes' work on one measurement, and how right it is: ``./alula bench perception``.

Each case runs in a process of its own, so that its peak of memory is its own. The node's whole way from the message's bytes to the answer
and the bare library on the same input take turns, so that both meet the same machine. CPU is that of all threads of the process; node and
library may use as many as the node does by default.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import resource
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np

from perception_bench.cases import CASES, Case, accuracy

EXIT_OK, EXIT_USAGE = 0, 2
FRAMES = 60
WARM_UP = 3


@dataclass(frozen=True)
class Figures:
    """Milliseconds a frame: wall clock and CPU, medians and 95th percentiles; peak memory of the case's process in MB."""

    wall_p50_ms: float
    wall_p95_ms: float
    cpu_p50_ms: float
    cpu_p95_ms: float

    @classmethod
    def of(cls, times_s: Sequence[tuple[float, float]]) -> Figures:
        """Sum up wall and CPU seconds of each frame."""
        wall, cpu = (np.array(column) * 1e3 for column in zip(*times_s, strict=True))
        return cls(*(float(np.percentile(values, share)) for values in (wall, cpu) for share in (50, 95)))


def timed(work: Callable[[], object]) -> tuple[float, float]:
    """Return wall and CPU seconds of the work."""
    wall_s, cpu_s = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - wall_s, time.process_time() - cpu_s


def measure(case: Case, frames: int) -> dict[str, object]:
    """Run node and bare library in turns; return both figures, and the peak of memory."""
    works = case.make()
    for work in works.values():
        for _ in range(WARM_UP):
            work()
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in works}
    for _ in range(frames):
        for name, work in works.items():
            times[name].append(timed(work))
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return {"case": case.name, "peak_mb": peak_mb, **{name: asdict(Figures.of(rows)) for name, rows in times.items()}}


def in_own_process(case: Case, frames: int) -> dict[str, object]:
    """Measure a case in a fresh process."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(measure, (case, frames))


def print_row(row: Mapping[str, object]) -> None:
    """Print one case: a line for the node, and one for each bare library with how much the node takes of it."""
    node = row["node"]
    assert isinstance(node, dict)  # noqa: S101 -- for the type checker
    for name, figures in row.items():
        if isinstance(figures, dict):
            cells = "".join(f"{figures[key]:9.1f}" for key in ("wall_p50_ms", "wall_p95_ms", "cpu_p50_ms", "cpu_p95_ms"))
            times = "".join(f"{node[key] / figures[key]:8.2f}x" for key in ("cpu_p50_ms", "wall_p50_ms"))
            last = f"{row['peak_mb']:9.0f}" if name == "node" else times
            sys.stdout.write(f"{row['case'] if name == 'node' else '':34}{name:22}{cells}{last}\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the bench that the command line asks for; return the exit code."""
    parser = argparse.ArgumentParser(prog="alula bench perception", description="Measures the perception nodes against bare libraries.")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures to this file")
    parser.add_argument("--case", metavar="WORDS", default="", help="only cases whose names begin with this")
    parser.add_argument("--frames", type=int, default=FRAMES, metavar="N", help=f"measure so many frames a case (default {FRAMES})")
    parser.add_argument(
        "--recording", type=Path, metavar="BAG", nargs="+", help="instead: report the nodes' judgements on recorded flights"
    )
    parser.add_argument(
        "--rendered",
        metavar="WORLD:SEED",
        nargs="+",
        help="instead: report the nodes' judgements on flights rendered along a world's route",
    )
    parser.add_argument(
        "--breaks",
        choices=["pictures", "clouds"],
        nargs="+",
        help="instead: break recordings in all known ways, those whose names begin with --case, and report what that made of the way ahead",
    )
    parser.add_argument(
        "--imperfections", default="off", metavar="WORDS", help="imperfections of a rendered flight, as for `alula fly` (default off)"
    )
    parser.add_argument(
        "--times", type=int, default=0, metavar="N", help="with --recording or --rendered: also break the sensors N times in each way"
    )
    options = parser.parse_args(arguments)
    if options.recording or options.rendered:
        return _judge_flights(options)
    if options.breaks:
        return _judge_breaks(options)
    chosen = [case for case in CASES if case.name.startswith(options.case)]
    if not chosen or options.frames < 1:
        sys.stderr.write(f"alula bench perception: no case begins with {options.case!r}; there are {[case.name for case in CASES]}\n")
        return EXIT_USAGE
    sys.stdout.write(f"{'case':34}{'':22}{'p50':>9}{'p95 ms':>9}{'CPU p50':>9}{'p95 ms':>9}{'MB | CPU':>9}{'wall':>9}\n")
    rows = []
    for case in chosen:
        rows.append(in_own_process(case, options.frames))
        print_row(rows[-1])
    table = accuracy()
    for line in table:
        sys.stdout.write(f"{line['what']}: {line['figure']}\n")
    if options.json:
        options.json.write_text(json.dumps({"cases": rows, "accuracy": table}, indent=1) + "\n")
    return EXIT_OK


def _judge_flights(options: argparse.Namespace) -> int:
    """Print what the nodes make of recorded and of rendered flights."""
    # Late: the simulator would count as memory of the cases.
    from perception_bench.recordings import judged, read, told
    from perception_bench.rendered import render
    from uav_simulator.errors import ConfigError

    makers = [partial(read, bag) for bag in options.recording or ()]
    for flight in options.rendered or ():
        world, _, seed = flight.rpartition(":")
        if not world or not seed.isdecimal():
            sys.stderr.write(f"alula bench perception: --rendered {flight!r}, expected WORLD:SEED, as in yard:1\n")
            return EXIT_USAGE
        makers.append(partial(render, world, int(seed), options.imperfections))
    rows = []
    try:
        for make in makers:
            for row in judged(make(), options.times):
                rows.append(row)
                sys.stdout.write(told(row) + "\n")
    except ConfigError as error:
        sys.stderr.write(f"alula bench perception: {error}\n")
        return EXIT_USAGE
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1) + "\n")
    return EXIT_OK


def _judge_breaks(options: argparse.Namespace) -> int:
    """Print what the nodes make of all kinds of broken pictures and clouds."""
    from perception_bench.consequences import Result, line, results, summed_up  # late: the simulator would count as memory of the cases

    rows, summary = [], []
    for what in options.breaks:
        found: list[Result] = []
        for result in results(what, options.case):
            found.append(result)
            rows.append({"what": what, **result.row()})
            sys.stdout.write(line(result) + "\n")
        summary.append(summed_up(what, found))
    sys.stdout.write("\n".join(summary) + "\n")
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1) + "\n")
    return EXIT_OK
