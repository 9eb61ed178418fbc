"""A record whose bits were flipped: every reader tells the damage by its place, or reads it as it was."""

from __future__ import annotations

import os
import random
import shutil
from pathlib import Path

import pytest

from alula.cli import conform, expect, replay
from alula.common.record import DECISIONS, EVENTS, FILE, MISSION, REPORTS, RecordFollower, RecordWriter
from alula.records.errors import AnalysisError
from alula.records.replay.deciding import Conditions, decide, read_mission
from alula.records.replay.outputs import write_out
from alula.records.replay.recorded import ReplayError, load
from alula.records.run import load_recorded_run
from alula.report.files import Problems
from alula.report.history import read_history
from alula.report.page.following import RunFollower

RECORDING = Path(os.environ["ALULA_ROOT"]) / "tests/recordings/mapping"
PLACE = "damaged at byte "


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Return the folder of a mission that was decided here, as a run leaves it."""
    folder = tmp_path_factory.mktemp("flown") / "run"
    recorded = load(RECORDING)
    write_out(folder, recorded, decide(read_mission(recorded), Conditions(out=folder)))
    return folder


def flipped(folder, to, seed, bits):
    """Copy a run and flip bits of its record."""
    shutil.copytree(folder, to)
    content = bytearray((to / FILE).read_bytes())
    chance = random.Random(seed)  # noqa: S311
    for place in chance.sample(range(8, len(content)), bits):
        content[place] ^= 1 << chance.randrange(8)
    (to / FILE).write_bytes(content)
    return to


@pytest.mark.parametrize("seed", range(12))
def test_every_reader_tells_flipped_bits_by_their_place(flown, tmp_path, seed, capsys):
    run = flipped(flown, tmp_path / "run", seed, 60)
    for command in (replay, expect):
        assert command.main([str(run)]) == 2
        assert PLACE in capsys.readouterr().err
    conform.main([str(run)])
    told = capsys.readouterr()
    assert PLACE in told.out + told.err
    problems = Problems()
    read_history(run / FILE, problems)
    assert any(PLACE in sentence for sentence in problems.sentences)
    follower = RunFollower(run)
    follower.poll()
    assert any(PLACE in sentence for sentence in follower.problems)


@pytest.mark.parametrize("seed", range(40))
def test_a_single_bit_is_told_or_changes_nothing(flown, tmp_path, seed):
    run = flipped(flown, tmp_path / "run", seed, 1)
    follower, before = RecordFollower(run / FILE), RecordFollower(flown / FILE)
    found, whole = follower.poll(), before.poll()
    assert found == whole[: len(found)]
    assert found == whole or follower.cut
    if follower.broken:
        with pytest.raises(ReplayError, match=PLACE):
            load(run)
        with pytest.raises(AnalysisError, match=PLACE):
            load_recorded_run(run)
    else:
        assert load_recorded_run(run).mission == load_recorded_run(flown).mission


@pytest.mark.parametrize(
    ("topic", "value", "told"),
    [
        (DECISIONS, {"number": 1, "kind": "start", "skillset": "a", "skill": "b", "inputs": {}}, "has no 'id'"),
        (REPORTS, {"state": "RUNNING"}, "has no 'id'"),
        (REPORTS, {"id": "1", "state": "FLYING"}, "makes no sense: 'FLYING' is not a valid ExecutionState"),
        (EVENTS, {"kind": "EXECUTION"}, "makes no sense: "),
    ],
)
def test_what_lacks_a_part_is_told_with_its_place(tmp_path, topic, value, told):
    writer = RecordWriter(tmp_path / FILE)
    writer.write(MISSION, 0, {"scenario": "mapping"})
    writer.write(topic, 1_500_000_000, value)
    writer.close()
    with pytest.raises(ReplayError) as error:
        load(tmp_path)
    assert f"{tmp_path / FILE}: the message on {topic} at 1.500 s of mission clock {told}" in str(error.value)
