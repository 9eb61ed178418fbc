"""The steps of a replay by themselves: a recording decided again, and what is written of it."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from alula.common import run_log
from alula.common.faults import parse_fault
from alula.common.record import DECISIONS, FILE, RecordWriter, read_record
from alula.records.replay.comparison import alike
from alula.records.replay.deciding import Conditions, bag_of, decide, read_mission
from alula.records.replay.outputs import same, trace_of, verdict, write_out
from alula.records.replay.recorded import ReplayError, load

RECORDING = Path(os.environ["ALULA_ROOT"]) / "tests/recordings/mapping"


@pytest.fixture(scope="module")
def recorded():
    return load(RECORDING)


def test_a_flight_is_decided_as_it_was_and_leaves_its_own_record(recorded, tmp_path):
    result = decide(read_mission(recorded), Conditions(out=tmp_path / "again"))
    write_out(tmp_path / "again", recorded, result)
    assert same(recorded, result)
    assert verdict(recorded, result)[0] == f"{len(recorded.decisions)} decisions, all as they were"
    assert len(trace_of(result, recorded.zero_s)) == len(recorded.decisions)
    assert {entry.topic for entry in read_record(tmp_path / "again")} >= {"/mission", "/decisions", "/events"}
    assert json.loads((tmp_path / "again/replay.json").read_text())["same"] is True
    assert run_log.read(tmp_path / "again", run_log.FAULT) == []


def account(recorded, out: Path, fail: list[str], spoiled: list[str]) -> list[tuple]:
    """Return the faults that the account of a replay tells of, seconds after the recorded lift-off."""
    result = decide(read_mission(recorded), Conditions(fail=fail, go_on=True, out=out))
    write_out(out, recorded, result, [parse_fault(text) for text in spoiled])
    told = run_log.read(out, run_log.FAULT)
    return [(one["sensor"], one["mode"], pytest.approx(one["t_s"] - recorded.zero_s, abs=0.05)) for one in told]


def test_the_account_has_each_begin_and_end_of_what_failed(recorded, tmp_path):
    assert account(recorded, tmp_path / "mocks", ["zed@5-6", "zed@8"], []) == [("zed", "mock", 5), ("zed", "ok", 6), ("zed", "mock", 8)]
    spoiled = account(recorded, tmp_path / "measurements", [], ["zed:dark@4-6", "lidar@5", "zed@900"])
    assert spoiled == [("zed", "dark", 4), ("lidar", "mock", 5), ("zed", "ok", 6)]


def test_a_record_that_breaks_off_before_the_first_decision_is_not_replayed(recorded, tmp_path):
    first = next(number for number, entry in enumerate(recorded.entries) if entry.topic == DECISIONS)
    writer = RecordWriter(tmp_path / FILE)
    for entry in recorded.entries[:first]:
        writer.write(entry.topic, entry.stamp_ns, entry.value)
    writer.close()
    whole = load(tmp_path)
    assert verdict(whole, decide(read_mission(whole), Conditions()))[0] == "0 decisions, all as they were"
    written = (tmp_path / FILE).read_bytes()
    (tmp_path / FILE).write_bytes(written[: len(written) // 2])
    with pytest.raises(ReplayError, match=r"breaks off before the mission's first decision"):
        read_mission(load(tmp_path))


def test_a_folder_that_holds_something_is_not_written_to(recorded, tmp_path):
    (tmp_path / FILE).touch()
    with pytest.raises(ReplayError, match="never overwrites"):
        decide(read_mission(recorded), Conditions(out=tmp_path))


def test_the_bag_is_the_one_that_was_given_or_lies_beside_the_record(recorded, tmp_path):
    assert bag_of(recorded, RECORDING) == RECORDING / "functional.bag"
    with pytest.raises(ReplayError, match="there is no such bag"):
        bag_of(recorded, tmp_path / "other.bag")


def test_numbers_are_alike_within_the_tolerance():
    assert alike({"target": {"x": 1.0}, "list": [1, 2.0]}, {"target": {"x": 1.0 + 1e-9}, "list": [1.0, 2]})
    assert not alike({"x": 1.0}, {"x": 1.001})
    assert not alike({"x": 1.0}, {"y": 1.0})
    assert not alike([1.0], [1.0, 2.0])
    assert alike("text", "text")
