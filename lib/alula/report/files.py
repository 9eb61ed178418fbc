"""Read files that a crash may have cut off."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from alula.common.errors import AlulaError


class ReportError(AlulaError):
    """Something in the run's folder can't be used; the message names it."""


class Problems:
    """The problems of a report, a sentence each: what could not be read or makes no sense is left out and named here."""

    def __init__(self) -> None:
        self._sentences: list[str] = []

    def note(self, sentence: str) -> None:
        """Add a sentence to the report's list of problems, unless it has it already."""
        if sentence not in self._sentences:
            self._sentences.append(sentence)

    @contextmanager
    def survive(self, what: str) -> Iterator[None]:
        """Turn any error of the block into a problem; what the block was to bind must have a value before."""
        try:
            yield
        except ReportError as error:
            self.note(str(error))
        except Exception as error:  # noqa: BLE001  (a report is read most closely after a crash: it must not crash itself)
            self.note(f"{what}: {type(error).__name__}: {error}".replace("\n", " "))

    @property
    def sentences(self) -> list[str]:
        """All problems in the order of their discovery."""
        return list(self._sentences)


def finite(value: object) -> float | None:
    """Return a finite number as a float, None for anything else (also for booleans, infinity and NaN)."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if math.isfinite(value) else None


def mapping(value: object) -> dict[str, object]:
    """Return a JSON object as it is, an empty one for anything else."""
    return value if isinstance(value, dict) else {}


def sequence(value: object) -> list[object]:
    """Return a JSON array as it is, an empty one for anything else."""
    return value if isinstance(value, list) else []


def read_json(path: Path) -> object:
    """Return what the file holds; raise ReportError when it is missing or no JSON."""
    try:
        value: object = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ReportError(f"{path.name} is missing") from None
    except (OSError, ValueError) as error:
        raise ReportError(f"{path.name} can't be read: {error}") from error
    return value
