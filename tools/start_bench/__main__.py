"""Measure how long commands take until their own work begins: ``./alula bench start``.

Each command is given nothing to do: help, a model of one resource, the end of a line to complete. So a time is that of the whole process,
from the shell that starts it until it has ended, and bounds the start from above. Wall clock; medians, by turns.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from alula.cli.checkout import ROOT

REPEAT = 15
MODEL = "skillset small { resource lamp { state { OFF ON } initial OFF transition { OFF -> ON ON -> OFF } } }\n"


def commands(folder: Path) -> dict[str, tuple[Sequence[str], Mapping[str, str]]]:
    """Return what is measured: the words of each command, and its variables."""
    model = folder / "small.skill"
    model.write_text(MODEL, encoding="utf-8")
    return {
        "alula --help": (["--help"], {}),
        "alula check --help": (["check", "--help"], {}),
        "alula check FILE --no-proofs": (["check", str(model), "--no-proofs"], {}),
        "alula check FILE": (["check", str(model)], {}),
        "completion of a command": ([], completing("alula ch")),
        "completion of a skill": ([], completing("alula start ")),
        "completion of a fault": ([], completing("alula run mapping --fail ")),
        "completion of a robot's own option": ([], completing("alula run mapping --")),
    }


def completing(line: str) -> dict[str, str]:
    """Return the variables by which a shell asks how a line goes on."""
    return {"_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line)), "_ARGCOMPLETE_STDOUT_FILENAME": os.devnull}


def measure(repeat: int) -> dict[str, list[float]]:
    """Return the milliseconds of each command, each time; raises OSError where the entry script can't be started."""
    entry = str(Path(os.environ[ROOT]) / "alula")
    taken: dict[str, list[float]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(repeat):
            for name, (words, variables) in commands(Path(folder)).items():
                begun = time.perf_counter()
                subprocess.run([entry, *words], env={**os.environ, **variables}, capture_output=True, check=False)
                taken.setdefault(name, []).append((time.perf_counter() - begun) * 1e3)
    return taken


def main(words: Sequence[str] | None = None) -> int:
    """Measure; return the exit code."""
    parser = argparse.ArgumentParser(prog="alula bench start", description="Measure how long the command line takes to start.")
    parser.add_argument("--repeat", type=int, default=REPEAT, metavar="N", help=f"how often each command is started (default {REPEAT})")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures to this file")
    given = parser.parse_args(words)
    if given.repeat < 1:
        parser.error(f"--repeat {given.repeat}: is a number of starts, from 1 on")
    taken = measure(given.repeat)
    if given.json is not None:
        given.json.write_text(json.dumps({"milliseconds": taken}, indent=1) + "\n", encoding="utf-8")
    sys.stdout.write("| command | median ms | slowest |\n|---|---|---|\n")
    for name, times in taken.items():
        sys.stdout.write(f"| {name} | {statistics.median(times):.0f} | {max(times):.0f} |\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
