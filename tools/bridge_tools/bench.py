"""Measure the bridge from end to end: ``./alula bench bridge``.

A publisher in one process, the bridge in another, a subscriber in a third: plain rospy and rclpy nodes. The floors, rospy to rospy and
rclpy to rclpy without a bridge, are measured in the same run. Figures are medians over the repeats.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import statistics
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from bridge_tools.bench_cases import FLAT_OUT, OFFICIAL, OFFICIAL_IDLE_PERCENT, OFFICIAL_START_S, Case, Official, TopicCase, all_cases
from bridge_tools.bench_run import Bench, BenchError, open_bench

PACED_S, QUICK_S = 10.0, 2.0
EXIT_OK, EXIT_FAILED, EXIT_USAGE = 0, 1, 2
START = "start and idle"
Figures = dict[str, float]
HEADINGS = (
    "case",
    "way",
    "received of sent",
    "p50 / p95 / p99 ms",
    "bridge CPU s, peak MB",
    "official: received",
    "p50 / p95 ms",
    "CPU s, peak MB",
)


def parse_arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Return the command line's values; wrong ones print the usage on stderr and exit with code 2."""
    parser = argparse.ArgumentParser(
        prog="alula bench bridge", description="Measures the bridge end to end, between real ROS 1 and ROS 2 nodes."
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures to this file")
    parser.add_argument(
        "--case", action="append", metavar="WORDS", help="only cases whose names begin with this, such as image; repeatable"
    )
    parser.add_argument("--repeat", type=int, default=3, metavar="N", help="measure each case N times (default 3)")
    parser.add_argument("--quick", action="store_true", help="each case once, for 2 s instead of 10: for a first look, not for comparing")
    return parser.parse_args(arguments)


def medians(runs: Sequence[Figures]) -> Figures:
    """Return the median of each figure, and the worst of what was received."""
    keys = {key for run in runs for key in run}
    result = {key: float(statistics.median(run[key] for run in runs if key in run)) for key in sorted(keys)}
    return result | ({"worst_received": min(run["received"] for run in runs)} if "received" in keys else {})


def received_text(case: Case, figures: Figures) -> str:
    """Tell how many arrived, a second where the sender had no limit."""
    if isinstance(case, TopicCase) and case.rate_hz == FLAT_OUT:
        return f"{figures['rate_hz']:.0f} / s"
    text = f"{figures['received']:.0f} of {figures['sent']:.0f}"
    return text if figures["worst_received"] == figures["received"] else f"{text} (worst {figures['worst_received']:.0f})"


def row(case: Case, figures: Figures) -> tuple[str, ...]:
    """Return a line of the table."""
    official = OFFICIAL.get((case.name, case.way), Official())
    times = " / ".join(f"{figures[key]:.2f}" for key in ("p50_ms", "p95_ms", "p99_ms") if key in figures)
    cost = f"{figures['bridge_cpu_s']:.2f}, {figures['bridge_peak_mb']:.0f}" if case.way.bridged else ""
    return (
        case.name,
        case.way.value,
        received_text(case, figures),
        times,
        cost,
        official.received,
        official.p50_p95_ms,
        official.cpu_s_peak_mb,
    )


def table(rows: Sequence[Sequence[str]]) -> str:
    """Return rows as a Markdown table."""
    lines = [HEADINGS, ["---"] * len(HEADINGS), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def start_text(figures: Figures) -> str:
    """Tell how long the bridge takes to begin, and what it takes while nothing crosses."""
    start = f"start to first message {figures['start_s']:.2f} s (official {OFFICIAL_START_S})"
    return f"{start}, idle {figures['idle_percent']:.1f} % of a core (official {OFFICIAL_IDLE_PERCENT})"


def measure(bench: Bench, case: Case, repeats: int, progress: str) -> Figures:
    """Run a case several times, telling how it goes."""
    runs = []
    for number in range(repeats):
        sys.stderr.write(f"{progress} {case.name}, {case.way.value}, run {number + 1} of {repeats}: ")
        sys.stderr.flush()
        figures = bench.run(case)
        sys.stderr.write(f"{figures['received']:.0f} of {figures['sent']:.0f}, p50 {figures.get('p50_ms', float('nan')):.2f} ms\n")
        runs.append(figures)
    return medians(runs)


def run(options: argparse.Namespace) -> str:
    """Measure, write the file, and return the table."""
    seconds, repeats = (QUICK_S, 1) if options.quick else (PACED_S, options.repeat)
    wanted = tuple(options.case or ("",))
    cases = [case for case in all_cases(seconds) if case.name.startswith(wanted)]
    results: list[tuple[Case, Figures]] = []
    texts = []
    with open_bench() as bench:
        for index, case in enumerate(cases):
            results.append((case, measure(bench, case, repeats, f"[{index + 1}/{len(cases)}]")))
        if START.startswith(wanted):
            start = medians([bench.start_and_idle(seconds) for _ in range(repeats)])
            texts.append(start_text(start))
    if options.json is not None:
        content = [{"case": case.name, "way": case.way.value, **figures} for case, figures in results]
        content += [{"case": START, **start}] if texts else []
        options.json.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    return "\n\n".join([table([row(case, figures) for case, figures in results]), *texts]) + "\n"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the benchmark; return the exit code."""
    options = parse_arguments(arguments)
    if "ALULA_ROOT" not in os.environ:
        sys.stderr.write("alula bench bridge: run it by ./alula bench bridge, or by setup/in_ros2 python -m bridge_tools.bench\n")
        return EXIT_USAGE
    known = sorted({case.name for case in all_cases(PACED_S)} | {START})
    unknown = [words for words in options.case or () if not any(name.startswith(words) for name in known)]
    if unknown or options.repeat < 1:
        problem = f"no case begins with '{unknown[0]}'; there are: {', '.join(known)}" if unknown else "--repeat has to be 1 or more"
        sys.stderr.write(f"alula bench bridge: {problem}\n")
        return EXIT_USAGE
    os.environ["ROS_DOMAIN_ID"] = str(random.Random(time.monotonic_ns()).randrange(1, 101))  # noqa: S311 - no secret
    try:
        sys.stdout.write(run(options))
    except BenchError as error:
        sys.stderr.write(f"\nalula bench bridge: {error}\n")
        return EXIT_FAILED
    return EXIT_OK


if __name__ == "__main__":
    sys.exit(main())
