"""Has many mutants judged, several at once, and keeps what became of each in a file."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Generic, Protocol, TypeVar

from mission_mutations.mutants import Mutant

Key = tuple[str, str, str]
"""Mission, kind and what was done: no two mutants have the same."""


class Judged(Protocol):
    """What became of a mutant."""

    @property
    def mission(self) -> str:
        """That of the mutant."""

    @property
    def kind(self) -> str:
        """That of the mutant."""

    @property
    def what(self) -> str:
        """As the mutant says it."""

    @property
    def cpu_s(self) -> float:
        """Seconds of the processor."""

    @property
    def said(self) -> str:
        """What became of it, in words."""

    @property
    def again(self) -> bool:
        """Return whether it is worth to be judged again."""

    def as_dict(self) -> Mapping[str, object]:
        """Return it as JSON has it."""


Told = TypeVar("Told", bound=Judged)


class Study(Generic[Told]):
    """Has mutants judged.

    Args:
        judge: judges one, in any process.
        read: makes what it returns of the fields in a file.
        file: is written as soon as something is known; what it has already is not judged again, unless it is worth it.
        seed: of the choice of mutants, for the file.
    """

    def __init__(self, judge: Callable[[Mutant], Told], read: Callable[..., Told], file: Path | None, seed: int) -> None:
        self._judge = judge
        self._file = file
        self._seed = seed
        known = json.loads(file.read_text(encoding="utf-8"))["mutants"] if file is not None and file.exists() else []
        self._known: dict[Key, Told] = {_key(one): one for one in (read(**fields) for fields in known) if not one.again}

    def run(self, some: Sequence[Mutant], processes: int) -> list[Told]:
        """Return what became of them, in order."""
        found: list[Told] = []
        with ProcessPoolExecutor(processes) as pool:
            judging = {_key(one): pool.submit(self._judge, one) for one in some if _key(one) not in self._known}
            for number, one in enumerate(some, 1):
                told = self._known.pop(_key(one), None) or judging[_key(one)].result()
                found.append(told)
                sys.stderr.write(f"{number} of {len(some)}: {told.said}, {told.cpu_s} s: {told.kind}: {told.what}\n")
                self._write([*found, *self._known.values()])
        return found

    def _write(self, several: Sequence[Told]) -> None:
        if self._file is not None:
            told = {"seed": self._seed, "mutants": [one.as_dict() for one in several]}
            self._file.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")


def _key(one: Mutant | Judged) -> Key:
    return one.mission, one.kind, one.what
