"""Measure what a flight costs: ``./alula bench flight``. Seconds of processor time, of each process, by phase."""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from flight_bench.figures import Figures, accuracy_of, as_json, ratio, table
from flight_bench.picture import draw
from flight_bench.watching import watch

FLIGHT = ("mapping", "--fail", "zed@30", "--rate", "0")
EXIT_OK, EXIT_FAILED, EXIT_INTERRUPTED = 0, 1, 130


class BenchError(Exception):
    """A flight that left no summary."""


def parse_arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Return the command line's values; wrong ones print the usage on stderr and exit with code 2."""
    parser = argparse.ArgumentParser(prog="alula bench flight", description="Measures the processor time of a flight.")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures to this file")
    parser.add_argument("--picture", type=Path, metavar="FILE", help="draw the processes' time, as PNG or SVG")
    parser.add_argument("--repeat", type=int, default=1, metavar="N", help="fly N times and tell medians (default 1)")
    parser.add_argument("--vs", type=Path, metavar="CHECKOUT", help="fly another checkout, set up as this one, by turns with this one")
    parser.add_argument("run", nargs="*", default=FLIGHT, metavar="-- RUN", help=f"arguments of `alula run` (default: {' '.join(FLIGHT)})")
    given = parser.parse_args(arguments)
    if given.repeat < 1:
        parser.error(f"--repeat {given.repeat}: at least one flight")
    if given.picture is not None and given.picture.suffix not in {".png", ".svg"}:
        parser.error(f"--picture {given.picture}: end the name with .png or .svg")
    if given.vs is not None and not (given.vs / "alula").is_file():
        parser.error(f"--vs {given.vs}: there is no `alula` in it; name a checkout")
    return given


def fly(checkout: Path, run: Sequence[str], folder: Path) -> Figures:
    """Fly once; raises BenchError."""
    out = folder / "run"
    command = [str(checkout / "alula"), "run", *run, "--robot", str(checkout), "--out", str(out)]
    taken = watch(command, out, folder / "words.txt", environment_of(checkout))
    try:
        summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    except OSError:
        words = (folder / "words.txt").read_text(encoding="utf-8", errors="replace").strip().splitlines()
        raise BenchError(f"the flight left no summary (exit code {taken.code}): {words[-1] if words else 'it said nothing'}") from None
    return Figures(str(checkout), str(summary["outcome"]), taken, accuracy_of(summary))


def environment_of(checkout: Path) -> dict[str, str]:
    """Return the environment for a checkout's commands; another one than this must not build into this one's folders."""
    own = checkout == Path(os.environ["ALULA_ROOT"])
    return {name: value for name, value in os.environ.items() if own or not name.startswith("ALULA_")}


def measure(options: argparse.Namespace) -> list[list[Figures]]:
    """Fly each checkout as often as wanted, by turns; return the flights of each."""
    checkouts = [Path(os.environ["ALULA_ROOT"]), *([options.vs.absolute()] if options.vs else [])]
    flown: list[list[Figures]] = [[] for _ in checkouts]
    for number in range(options.repeat):
        for checkout, flights in zip(checkouts, flown, strict=True):
            _say(f"flight {number + 1} of {options.repeat}: {checkout}")
            with tempfile.TemporaryDirectory(prefix="alula-bench-") as folder:
                flights.append(fly(checkout, options.run, Path(folder)))
    return flown


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the benchmark; return the exit code."""
    options = parse_arguments(arguments)
    try:
        flown = measure(options)
    except KeyboardInterrupt:
        _say("alula bench flight: interrupted")
        return EXIT_INTERRUPTED
    except BenchError as error:
        _say(f"alula bench flight: {error}")
        return EXIT_FAILED
    if options.json is not None:
        told = [one for flights in flown for one in as_json(flights)]
        options.json.write_text(json.dumps({"run": list(options.run), "flights": told}, indent=1) + "\n", encoding="utf-8")
    if options.picture is not None:
        draw(flown, options.picture)
    lines = [table(flights) for flights in flown] + ([ratio(*flown)] if options.vs else [])
    sys.stdout.write("\n\n".join(lines) + "\n")
    return EXIT_OK


def _say(text: str) -> None:
    sys.stderr.write(text + "\n")


if __name__ == "__main__":
    sys.exit(main())
