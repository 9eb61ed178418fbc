"""The table of a campaign: a line of JSON a run, written when it is over, so that no crash loses more than the runs under way."""

from __future__ import annotations

import fcntl
import json
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any, BinaryIO

from alula.campaign.failures import KINDS
from alula.campaign.plan import Campaign
from alula.common.files import strict, write_json, write_text
from alula.records.errors import AnalysisError

ROWS, PLAN = "runs.jsonl", "campaign.json"
COLUMNS = frozenset(
    (
        *("run", "scenario", "faults", "outcome", "landed", "open", "problems", "collisions", "min_clearance_m", "conforms", "exit_code"),
        *("failures", "answers"),
    )
)
"""What the coverage reads of a row."""

Row = Mapping[str, Any]


class Table:
    """The table in a campaign's folder, one row for each run. A row that a crash cut off is done again.

    Raises:
        AnalysisError: the folder has another campaign in it, one is being done there, or it can't be used.
    """

    def __init__(self, folder: Path, campaign: Campaign) -> None:
        self._path = folder / ROWS
        self.rows: dict[int, Row] = {}
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._plan = self._claim(folder, campaign)
            try:
                self._read({planned.number for planned in campaign.runs})
            except AnalysisError:
                self._plan.close()
                raise
            self._file: BinaryIO = self._path.open("ab")
        except OSError as error:
            raise AnalysisError(f"{folder}: can't hold a campaign: {error.strerror or error}") from None

    def _claim(self, folder: Path, campaign: Campaign) -> BinaryIO:
        """Take the folder for this process, as long as it has the returned file open: two campaigns in it would do each run twice."""
        plan = folder / PLAN
        asked = json.loads(json.dumps(campaign.as_dict()))
        if not plan.is_file():
            if any(folder.iterdir()):
                raise AnalysisError(f"{folder}: is not empty and holds no campaign; choose another folder with --out")
            write_json(plan, asked)
        elif _json(plan.read_bytes()) != asked:
            raise AnalysisError(f"{folder}: holds another campaign; choose another folder with --out, or remove this one")
        claim = plan.open("rb")
        try:
            fcntl.flock(claim, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            claim.close()
            raise AnalysisError(
                f"{folder}: a campaign is being done there; wait for its end, or choose another folder with --out"
            ) from None
        return claim

    def _read(self, numbers: Collection[int]) -> None:
        """Read the rows that are whole, and leave no others in the file."""
        lines = self._path.read_bytes().splitlines(keepends=True) if self._path.is_file() else []
        whole = [row for line in lines if line.endswith(b"\n") and _is_row(row := _json(line), numbers)]
        for row in whole:
            self._check_kinds(row)
        self.rows = {row["run"]: row for row in whole}
        if len(whole) < len(lines):
            write_text(self._path, b"".join(map(_line, whole)).decode())

    def _check_kinds(self, row: Row) -> None:
        """Refuse a row of another version, whose failures the coverage doesn't know."""
        for failure in row["failures"]:
            if failure["kind"] not in KINDS:
                raise AnalysisError(
                    f"{self._path}: run {row['run']} has a failure of the kind `{failure['kind']}`; there are {', '.join(KINDS)}. Go on "
                    "with the version that wrote it, or choose another folder with --out"
                )

    def add(self, rows: Iterable[Row]) -> None:
        """Write rows, through to the disk."""
        for row in rows:
            self.rows[int(row["run"])] = row
            self._file.write(_line(row))
        self._file.flush()

    def finish(self) -> None:
        """Put the rows in the order of the runs: however often it was interrupted, the table is the same."""
        self._file.close()
        self._plan.close()
        write_text(self._path, b"".join(_line(self.rows[number]) for number in sorted(self.rows)).decode())


def _json(text: bytes) -> Any:
    """Return the JSON value of a text, None where it is no JSON."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None


def _is_row(row: Any, numbers: Collection[int]) -> bool:
    """Return whether this is what the coverage needs of one of these runs."""
    return isinstance(row, dict) and row.keys() >= COLUMNS and isinstance(row["run"], int) and row["run"] in numbers


def _line(row: Row) -> bytes:
    return json.dumps(strict(row), allow_nan=False).encode() + b"\n"
