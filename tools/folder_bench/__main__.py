"""`./alula bench folders [--json FILE] [--files 50,100,200,400]`: what the check of a folder of trees costs.

Folders are written with 25 nodes a file, whose trees use one another in three ways, and are checked as `alula check FOLDER` does, each in a
process of its own: seconds of the processor, peak memory. A line is printed as soon as it is measured.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from alula.api.checking import checked_files
from alula.common.garbage import collect_seldom
from alula.common.robots import meaning
from growing_bench import Row, measured_apart, peak_mb, tell_row, tell_rows, write_rows

COLUMNS = "{shape:<10}{files:>8}{nodes:>10}{cpu_s:>10}{peak_mb:>10}{findings:>10}"
NODES = 25
"""Of a file."""
DEEPEST = 100
"""Trees that use one another in a chain."""


def chain(number: int, count: int) -> list[int]:
    """Return what a tree uses where each uses the next one, a hundred of them in a row."""
    return [number + 1] if (number + 1) % DEEPEST and number + 1 < count else []


def bush(number: int, count: int) -> list[int]:
    """Return what a tree uses where each uses two others."""
    return [one for one in (2 * number + 1, 2 * number + 2) if one < count]


def shared(number: int, count: int) -> list[int]:
    """Return what a tree uses where half of the trees are missions that use one and the same eight of the other half."""
    return list(range(count // 2, min(count, count // 2 + 8))) if number < count // 2 else []


SHAPES: Mapping[str, Callable[[int, int], list[int]]] = {"chain": chain, "bush": bush, "shared": shared}


def write(folder: Path, shape: str, count: int) -> None:
    """Write a folder of so many files, a tree each, with leaves that nobody declares."""
    for number in range(count):
        uses = SHAPES[shape](number, count)
        leaves = [_leaf(number, one) for one in range(NODES - len(uses) - 1)]
        used = [f'<SubTree ID="T{one}" _autoremap="true"/>' for one in uses]
        body = "\n".join([*leaves, *used])
        tree = f'<BehaviorTree ID="T{number}"><Sequence>{body}</Sequence></BehaviorTree>'
        (folder / f"t{number:04}.xml").write_text(f'<root BTCPP_format="4">{tree}</root>\n', encoding="utf-8")


def _leaf(number: int, one: int) -> str:
    if one % 3:
        return f'<Action ID="Do{(number + one) % 60}" goal="{{goal{one}}}"/>'
    return f'<Condition ID="Is{one}" level="{{goal{one}}}"/>'


def measure(shape: str, count: int) -> Row:
    """Check a folder in this process; proofs aside, which a folder of others has none of."""
    collect_seldom()
    with tempfile.TemporaryDirectory() as folder, meaning(None):
        write(Path(folder), shape, count)
        begun = time.process_time()
        files = checked_files([folder])
        taken = time.process_time() - begun
    return {
        "shape": shape,
        "files": count,
        "nodes": count * NODES,
        "cpu_s": round(taken, 2),
        "peak_mb": peak_mb(),
        "findings": sum(len(file.findings) for file in files),
    }


def main(words: Sequence[str] | None = None) -> int:
    """Measure all shapes and sizes; print a table, and write JSON where it is wanted."""
    options = _parser().parse_args(words)
    if options.one:
        shape, count = options.one
        return tell_row(measure(shape, int(count)))
    write_rows(options.json, "folders", tell_rows(COLUMNS, _all(options.files)))
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="alula bench folders", description="Measure what the check of a folder of trees costs.")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures to this file")
    parser.add_argument("--files", type=_numbers, default=_numbers("50,100,200,400"), help="numbers of files")
    parser.add_argument("--one", nargs=2, metavar=("SHAPE", "FILES"), help="measure only this folder, in this process")
    return parser


def _numbers(text: str) -> list[int]:
    return [int(number) for number in text.split(",")]


def _all(counts: Sequence[int]) -> Iterator[Row]:
    """Yield a row for each folder, each measured in a process of its own."""
    for shape in SHAPES:
        for count in counts:
            yield measured_apart("folder_bench", "--one", shape, str(count))


if __name__ == "__main__":
    sys.exit(main())
