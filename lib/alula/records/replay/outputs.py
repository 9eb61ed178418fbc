"""The outputs of a replay besides its own record: the trace of its decisions, the verdict, and the faults."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from alula.common.faults import MOCKED, FaultRequest, changes_of, spans_of
from alula.common.files import write_json, write_text
from alula.common.run_log import note_mocked
from alula.records.replay.recorded import Recorded
from alula.records.replay.replay import Result


def trace_of(result: Result, zero_s: float) -> list[dict[str, object]]:
    """Return the decisions as they are written; the same replay gives the same, byte for byte."""
    return [{**vars(decision), "t_s": round(decision.t_s - zero_s, 6)} for decision in result.decisions]


def same(recorded: Recorded, result: Result) -> bool:
    """Return whether the replay made the recorded decisions and came to the recorded outcome."""
    ended_alike = result.end is None or not recorded.outcome or result.end.outcome.value == recorded.outcome
    return result.difference is None and ended_alike


def verdict(recorded: Recorded, result: Result) -> list[str]:
    """Return the verdict in lines: where the replay first differs from the record, or that it does not."""
    lines = []
    if not recorded.whole:
        lines.append(f"the record breaks off after {len(recorded.decisions)} decisions; replayed up to there")
    if result.difference is not None:
        lines += result.difference.lines(recorded.zero_s)
        now = "stopped there" if result.end is None else result.end.outcome.value
        return [*lines, f"outcome then: {recorded.outcome or 'unknown'}, now: {now}"]
    lines.append(f"{len(result.decisions)} decisions, all as they were")
    if result.end is not None:
        lines.append(f"outcome: {result.end.outcome.value}{f': {result.end.reason}' if result.end.reason else ''}")
    return lines


def write_out(out: Path, recorded: Recorded, result: Result, spoiled: Sequence[FaultRequest] = ()) -> None:
    """Write what is not in the replay's own record; ``spoiled``: faults of measurements, which no mock has had."""
    write_text(out / "trace.jsonl", "".join(json.dumps(line) + "\n" for line in trace_of(result, recorded.zero_s)))
    _note_account(out, recorded, result, spoiled)
    difference = None if result.difference is None else result.difference.as_dict()
    write_json(
        out / "replay.json", {"of": str(recorded.path), "same": same(recorded, result), "difference": difference, "notes": result.notes}
    )


def _note_account(out: Path, recorded: Recorded, result: Result, spoiled: Sequence[FaultRequest]) -> None:
    ended_s = result.simulated_s
    spans = [
        *spans_of(result.faults, begun_s=recorded.begun_s, lift_off_s=result.lift_off_s, ended_s=ended_s, first_s=result.first_s),
        *spans_of(spoiled, begun_s=recorded.begun_s, lift_off_s=recorded.lift_off_s, ended_s=ended_s),
    ]
    note_mocked(out, ended_s, result.wall_s, changes_of(spans, ended_s, MOCKED), result.notes)
