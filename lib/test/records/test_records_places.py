"""What a run's files say hangs on no folder that one stands in, and on no robot that is meant."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import pytest

from alula.common.record import FILE, RecordWriter
from alula.common.robots import VARIABLE, load_robot_folder, meaning
from alula.common.runs import robot_of
from alula.missions.record import EVENTS
from alula.records.comparing.rendering import lines
from alula.records.comparing.sides import compare, load_side
from alula.records.conformance.judging import judge
from alula.records.logs import read_log
from alula.records.run import load_recorded_run
from alula.report.facts import RunFacts
from alula.report.making import make_report

ALULA_ROOT = Path(os.environ["ALULA_ROOT"])
ROVER = load_robot_folder(ALULA_ROOT / "examples" / "rover")
DRONE = load_robot_folder(ALULA_ROOT)
PLACES = (ROVER.root, DRONE.root, Path("/"))


def run_of(robot: Path, folder: Path) -> Path:
    """Return a run in which the rover leaves its state of departure after five seconds; it tells of no account of a mission."""
    assert ROVER.departure is not None
    resource, state = ROVER.departure
    folder.mkdir(parents=True)
    (folder / "run.json").write_text(json.dumps({"robot": str(robot)} if robot != folder else {}))
    writer = RecordWriter(folder / FILE)
    for sequence, (at_s, from_state, to_state) in enumerate([(1.0, "X", state), (6.0, state, "X")], 1):
        event = {"sequence": sequence, "stamp_s": at_s, "skillset": "base", "kind": "TRANSITION", "resource": resource, "cause": "extern"}
        writer.write(EVENTS, round(at_s * 1e9), {**event, "from_state": from_state, "to_state": to_state})
    writer.close()
    (folder / "summary.json").write_text("{}")
    return folder


@pytest.mark.parametrize("place", PLACES, ids=["rover", "drone", "nowhere"])
@pytest.mark.parametrize("named", [True, False], ids=["named", "above"])
def test_a_run_is_one_of_the_robot_that_its_files_name(place: Path, named: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: FBT001
    if named:
        folder = run_of(ROVER.root, tmp_path / "run")
    else:
        shutil.copytree(ROVER.root, tmp_path / "robot", ignore=shutil.ignore_patterns("runs", "build", "install"))
        folder = run_of(tmp_path / "robot" / "runs" / "one", tmp_path / "robot" / "runs" / "one")
    monkeypatch.chdir(place)
    monkeypatch.delenv(VARIABLE, raising=False)
    if place == DRONE.root:
        monkeypatch.setenv(VARIABLE, str(DRONE.root))
    with meaning(DRONE if place == DRONE.root else None):
        assert load_recorded_run(folder).origin_s == 6.0
        told = list(lines(compare([load_side(folder, "a"), load_side(folder, "b")])))
        units = load_side(folder, "a").units
    monkeypatch.chdir(ROVER.root)
    assert told == list(lines(compare([load_side(folder, "a"), load_side(folder, "b")])))
    assert {one.replace(".", " ") for one in ROVER.page["figures"]} <= set(units)
    assert not {one.replace(".", " ") for one in set(DRONE.page["figures"]) - set(ROVER.page["figures"])} & set(units)


@pytest.mark.parametrize("place", PLACES, ids=["rover", "drone", "nowhere"])
def test_a_run_without_a_robot_has_none_wherever_one_stands(place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = run_of(tmp_path / "gone", tmp_path / "run")
    monkeypatch.chdir(place)
    assert robot_of(folder) is None
    assert load_recorded_run(folder).origin_s == 1.0
    assert robot_of(tmp_path / "there" / "is" / "none.mcap") is None


@pytest.mark.parametrize("place", PLACES, ids=["rover", "drone", "nowhere"])
def test_a_log_is_held_against_the_models_of_its_own_robot(place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = run_of(ROVER.root, tmp_path / "run")
    monkeypatch.chdir(place)
    monkeypatch.delenv(VARIABLE, raising=False)
    with meaning(DRONE if place == DRONE.root else None):
        assert [one.skillset for one in judge(read_log(folder)).findings] == ["base"]  # a state of that model, entered by no transition


@pytest.mark.parametrize("place", PLACES, ids=["rover", "drone", "nowhere"])
def test_a_report_is_made_in_the_words_of_the_robot_of_its_run(place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = run_of(ROVER.root, tmp_path / "run")
    scenario = min(ROVER.scenarios.glob("*.yaml")).stem
    monkeypatch.chdir(place)
    monkeypatch.delenv(VARIABLE, raising=False)
    with meaning(DRONE if place == DRONE.root else None):
        make_report(RunFacts(scenario, 0, folder, (), (), 0, mock=True))
    assert json.loads((folder / "summary.json").read_text())["lift_off"] == {"stamp_s": 6.0, "source": ROVER.departure[0]}
