"""The table of a campaign: a line of JSON a flight, written when it is over, so that no crash loses more than the flights under way."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, BinaryIO

from alula_common.files import strict, write_json, write_text
from run_analysis.campaign.plan import Campaign
from run_analysis.errors import AnalysisError

ROWS, PLAN = "flights.jsonl", "campaign.json"

Row = Mapping[str, Any]


class Table:
    """The rows in a folder. What a crash has cut off is flown again.

    Raises:
        AnalysisError: the folder has another campaign in it, or can't be used.
    """

    def __init__(self, folder: Path, campaign: Campaign) -> None:
        self._path = folder / ROWS
        self.rows: dict[int, Row] = {}
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._claim(folder, campaign)
            kept = self._read()
            self._file: BinaryIO = self._path.open("ab")
            self._file.truncate(kept)
        except OSError as error:
            raise AnalysisError(f"{folder}: can't hold a campaign: {error.strerror or error}") from None

    def _claim(self, folder: Path, campaign: Campaign) -> None:
        plan = folder / PLAN
        asked = json.loads(json.dumps(campaign.as_dict()))
        if not plan.is_file():
            if any(folder.iterdir()):
                raise AnalysisError(f"{folder}: is not empty and holds no campaign; choose another folder with --out")
            write_json(plan, asked)
        elif json.loads(plan.read_text(encoding="utf-8")) != asked:
            raise AnalysisError(f"{folder}: holds another campaign; choose another folder with --out, or remove this one")

    def _read(self) -> int:
        """Read the rows that are whole; return how many bytes they take."""
        kept = 0
        for line in self._path.read_bytes().splitlines(keepends=True) if self._path.is_file() else ():
            try:
                row = json.loads(line)
                number = int(row["flight"])
            except (ValueError, TypeError, KeyError):
                break
            if not line.endswith(b"\n"):
                break
            self.rows[number] = row
            kept += len(line)
        return kept

    def add(self, rows: Iterable[Row]) -> None:
        """Write rows, through to the disk."""
        for row in rows:
            self.rows[int(row["flight"])] = row
            self._file.write(_line(row))
        self._file.flush()

    def finish(self) -> None:
        """Put the rows in the order of the flights: however often it was interrupted, the table is the same."""
        self._file.close()
        write_text(self._path, b"".join(_line(self.rows[number]) for number in sorted(self.rows)).decode())


def _line(row: Row) -> bytes:
    return json.dumps(strict(row), allow_nan=False).encode() + b"\n"
