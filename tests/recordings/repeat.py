"""Replay recordings again and again, at once, at many rates and under load: ``repeat.py RUN...``; are the decisions the same bytes?

A line of standard output for each recording and depth; ends with 0 (the same each time), 1 (not), 2 (one can't be replayed).
"""

from __future__ import annotations

import argparse
import hashlib
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

DEPTHS = ("skills", "functional", "sensors")
RATES = (0.5, 0.7, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 35.0, 50.0)
SAME, OTHERWISE, CANNOT_REPLAY = 0, 1, 2


@contextmanager
def load(processes: int) -> Iterator[None]:
    """Keep so many processes busy meanwhile."""
    busy = [subprocess.Popen([sys.executable, "-c", "while True: sum(range(100000))"]) for _ in range(processes)]
    try:
        yield
    finally:
        for process in busy:
            process.kill()
            process.wait()


def replays(run: Path, depth: str, rates: Sequence[float]) -> list[tuple[int, bytes, str]]:
    """Replay a recording at all rates at the same time; return of each how it ended, its decisions, and what it said."""
    words = [sys.executable, "-m", "alula_flight.replay", str(run), "--from", depth, "--json", "--rate"]
    started = [subprocess.Popen([*words, str(rate)], stdout=subprocess.PIPE, stderr=subprocess.PIPE) for rate in rates]
    told = [process.communicate() for process in started]
    return [(process.returncode, out, said.decode()) for process, (out, said) in zip(started, told, strict=True)]


def repeat(run: Path, depth: str, rates: Sequence[float]) -> int:
    """Replay a recording and tell whether its decisions were the same each time; return the exit code."""
    done = replays(run, depth, rates)
    refused = next((said for code, _, said in done if code == CANNOT_REPLAY), None)
    if refused is not None:
        sys.stdout.write(f"{run.name} from {depth}: {refused.strip()}\n")
        return CANNOT_REPLAY
    traces = Counter((code, out) for code, out, _ in done)
    (_, trace), times = traces.most_common(1)[0]
    digest, decisions = hashlib.sha256(trace).hexdigest()[:16], len(trace.splitlines())
    as_recorded = sum(code == SAME for code, _, _ in done)
    told = f"{times} of {len(done)} traces are equal ({decisions} decisions, {digest}), {as_recorded} decide as recorded"
    sys.stdout.write(f"{run.name} from {depth}: {told}\n")
    sys.stdout.flush()
    return SAME if times == len(done) else OTHERWISE


def main(words: Sequence[str] | None = None) -> int:
    """Repeat; return the exit code."""
    parser = argparse.ArgumentParser(description="Replay recordings again and again: are the decisions the same bytes?")
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN")
    parser.add_argument("--from", dest="depths", action="append", choices=DEPTHS, help="default: all three")
    parser.add_argument("--rate", dest="rates", action="append", type=float, help=f"default: {' '.join(f'{rate:g}' for rate in RATES)}")
    parser.add_argument("--load", type=int, default=2, metavar="N", help="keep N processes busy meanwhile (default 2)")
    given = parser.parse_args(words)
    with load(given.load):
        return max(repeat(run, depth, given.rates or RATES) for run in given.runs for depth in given.depths or DEPTHS)


if __name__ == "__main__":
    sys.exit(main())
