"""A mission that is a file, seen by others while it runs over mocks: the log of its run, and viewers that are attached to it."""

from __future__ import annotations

import os
import signal
import struct
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

pytest.importorskip("py_trees")

from alula.campaign.mocked_scenarios import load_mocked_scenario
from alula.cli import run
from alula.common import run_log
from alula.common.record import TREE, read_record
from alula.common.scenarios import scenarios_folder
from alula.missions.director import Outcome
from alula.missions.mocked import MockedMission
from alula.missions.record import STOP_LOG, TREE_LOG
from alula.trees.groot.address import Address, ServerError
from alula.trees.groot.btlog import Log, read_log
from alula.trees.groot.protocol import Status

HALFWAY_S = 30.0  # mission clock: it flies, and maps
KILLED = """
import os, pathlib, signal, sys
from test_missions_watched import HALFWAY_S, mission
flown = mission("mapping", pathlib.Path(sys.argv[1]))
flown.world.clock.after(HALFWAY_S, lambda: os.kill(os.getpid(), signal.SIGKILL))
flown.run()
"""


def mission(scenario: str, out: Path | None = None, groot: str = "") -> MockedMission:
    """Return a mission over mocks, about to run."""
    flights = load_mocked_scenario(scenario)
    return MockedMission(flights.skillsets, flights.behaviour, flights.plan, out=out, groot=groot)


def nodes(log: Log) -> list[str]:
    """Return the names of the nodes, by their uids from 1."""
    tree = ET.fromstring(log.xml)  # noqa: S314 - a log of this test
    named = {int(node.get("_uid", 0)): node.get("name") or node.get("_fullpath", "") for node in tree.iter()}
    return [named[uid].rpartition("/")[2].partition("::")[0] for uid in sorted(named) if uid]


def ran(log: Log) -> set[int]:
    return {one.uid for one in log.transitions if one.status is not Status.IDLE}


def walk(view: dict) -> list[dict]:
    return [view, *(node for child in view["children"] for node in walk(child))]


@pytest.mark.parametrize("scenario", ["mapping", "inspection"])
def test_the_log_of_a_run_has_the_nodes_that_ran_and_no_others(scenario: str, tmp_path: Path) -> None:
    flown = mission(scenario, tmp_path)
    assert flown.run().outcome is Outcome.ACCOMPLISHED
    log = read_log(tmp_path / TREE_LOG)
    views = [walk(entry.value) for entry in read_record(tmp_path) if entry.topic == TREE]
    assert nodes(log) == [node["name"] for node in views[-1]]
    assert ran(log) == {uid for view in views for uid, node in enumerate(view, start=1) if node["status"] != "INVALID"}
    assert len(ran(log)) < len(nodes(log))
    assert log.transitions[-1].at_us <= flown.world.clock.now_ns // 1000
    last = {one.uid: one.status for one in log.transitions}
    assert Status.RUNNING not in last.values()


def test_a_crash_leaves_a_log_that_reads(tmp_path: Path) -> None:
    died = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path)], cwd=Path(__file__).parent, check=False, timeout=120)
    assert died.returncode == -signal.SIGKILL
    log = read_log(tmp_path / TREE_LOG)
    last = {one.uid: one.status for one in log.transitions}
    running = {name for uid, name in enumerate(nodes(log), start=1) if last.get(uid) is Status.RUNNING}
    assert {"map", "watch with the ZED", "fly and map"} <= running
    assert "land" not in running


def test_what_an_abort_halts_is_in_the_log(tmp_path: Path) -> None:
    flown = mission("mapping", tmp_path)
    flown.world.clock.after(HALFWAY_S, lambda: flown.abort("told to end"))
    assert flown.run().outcome is Outcome.ABORTED
    log = read_log(tmp_path / TREE_LOG)
    map_uid = nodes(log).index("map") + 1
    assert [one.status for one in log.transitions if one.uid == map_uid] == [Status.RUNNING, Status.IDLE]


def test_after_an_abort_viewers_and_a_log_have_what_stops_the_robot(tmp_path: Path) -> None:
    pytest.importorskip("zmq")
    from trees_viewer import Viewer

    address = Address(port=0).looked_up()
    flown = mission("mapping", tmp_path, groot=str(address))
    viewer = Viewer(address)
    numbers, xml, statuses = [], [], []

    def look() -> None:
        header, text = viewer.ask("T")
        numbers.append(header[6:])
        xml.append(text.decode())
        statuses.append(dict(struct.iter_unpack("<HB", viewer.ask("S")[1])))

    for at_s in (HALFWAY_S, HALFWAY_S + 1.0):
        flown.world.clock.after(at_s, look)
    flown.world.clock.after(HALFWAY_S + 0.5, lambda: flown.abort("told to end"))
    assert flown.run().outcome is Outcome.ABORTED
    viewer.socket.close()
    assert numbers[0] != numbers[1], "another tree has another number"
    assert ['ID="mapping"' in text for text in xml] == [True, False]
    assert ['ID="stop_here"' in text for text in xml] == [True, True]
    assert not statuses[0].keys() & statuses[1].keys(), "who goes on with the tree of before takes none of the new nodes for its own"
    assert Status.RUNNING in statuses[1].values()
    log = read_log(tmp_path / STOP_LOG)
    assert log.xml == xml[1]
    assert {one.uid for one in log.transitions} <= statuses[1].keys()
    last = {one.uid: one.status for one in log.transitions}
    assert last[min(last)] in {Status.SUCCESS, Status.IDLE}
    assert any(one.status is Status.SUCCESS for one in log.transitions)


def test_a_log_that_can_not_be_written_is_a_problem_of_the_record_and_no_end(tmp_path: Path) -> None:
    (tmp_path / TREE_LOG).mkdir()
    assert mission("mapping", tmp_path).run().outcome is Outcome.ACCOMPLISHED
    assert run_log.account(tmp_path, read_record(tmp_path))["problems"] == [f"{TREE_LOG} could not be written: Is a directory"]


def test_btview_is_attached_to_a_mission_that_runs() -> None:
    pytest.importorskip("zmq")
    pytest.importorskip("btview")
    address = Address(port=0).looked_up()
    flown = mission("mapping", groot=str(address))
    shown: list[tuple[str, dict]] = []

    def look() -> None:
        words = ["snapshot", "--uid", "--no-color", "--ascii", "--timeout", "20", "--port", str(address.port)]
        command, wide = [sys.executable, "-m", "btview", *words], {**os.environ, "COLUMNS": "200"}
        done = subprocess.run(command, env=wide, capture_output=True, text=True, check=True, timeout=60)
        shown.append((done.stdout, flown.director.view().as_dict()))

    flown.world.clock.after(HALFWAY_S, look)
    assert flown.run().outcome is Outcome.ACCOMPLISHED
    ((snapshot, view),) = shown
    rows = [line.split("#")[1].split() for line in snapshot.splitlines() if "#" in line]
    running = {int(row[0]) for row in rows if row[-1] == "RUNNING"}
    assert running == {uid for uid, node in enumerate(walk(view), start=1) if node["status"] == "RUNNING"}
    assert running
    assert "fly straight" in snapshot
    assert address.looked_up() == address, "nothing listens when the mission is over"


def test_a_port_that_others_hold_is_refused_before_anything_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("zmq")
    address = Address(port=0).looked_up()
    shown = mission("mapping", groot=str(address))
    with pytest.raises(ServerError, match="Address already in use; choose others"):
        mission("mapping", groot=str(address))
    words = ["mapping", "--mock", "--out", str(tmp_path / "run"), "--groot", str(address.port)]
    assert run.main(words) == run.CANNOT_START
    assert capsys.readouterr().err.startswith(f"alula run: --groot: the tree can't be shown on 127.0.0.1, ports {address.port} and")
    assert not (tmp_path / "run").exists()
    shown.run()
    assert run.main(words) == 0
    assert f"find the tree at {address}" in capsys.readouterr().err
    assert (tmp_path / "run" / TREE_LOG).exists()


def test_without_zeromq_viewers_are_refused_and_the_log_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "alula.trees.groot.server", raising=False)
    monkeypatch.setitem(sys.modules, "zmq", None)
    with pytest.raises(ServerError, match=r"viewers need the Python package zmq; pip install 'alula\[groot\]' brings it"):
        mission("mapping", groot="127.0.0.1:1667")
    assert mission("mapping", tmp_path).run().outcome is Outcome.ACCOMPLISHED
    assert read_log(tmp_path / TREE_LOG).transitions


def test_a_mission_that_is_no_file_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    python = (scenarios_folder() / "mapping.yaml").read_text(encoding="utf-8").replace("missions/mapping.xml", "by_hand:plan")
    (tmp_path / "scenarios").mkdir()
    (tmp_path / "scenarios/mapping.yaml").write_text(python, encoding="utf-8")
    monkeypatch.setattr("alula.common.scenarios.scenarios_folder", lambda: tmp_path / "scenarios")
    assert run.main(["mapping", "--mock", "--out", str(tmp_path / "run")]) == run.CANNOT_START
    assert capsys.readouterr().err == "alula run: the mission by_hand:plan is no file of a tree; name one: missions/NAME.xml\n"
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("node", ["fly straight", "leg"])
def test_the_record_tells_what_the_file_says_of_a_node(node: str, tmp_path: Path) -> None:
    mission("mapping", tmp_path).run()
    view = next(entry.value for entry in read_record(tmp_path) if entry.topic == TREE)
    told = next(one for one in walk(view) if one["name"] == node)
    lines = (scenarios_folder().parent / "missions/mapping.xml").read_text(encoding="utf-8").splitlines()
    line = next(number for number, text in enumerate(lines, start=1) if f'name="{node}"' in text)
    assert told["place"] == f"mapping.xml:{line}"
    if node == "fly straight":
        assert told["type"] == "navigation.goto_straight"
        assert told["ports"] == {"target": "{waypoint}", "speed": "{speed_m_s}", "outcome": "{straight}"}
        page = (tmp_path / "tree.svg").read_text(encoding="utf-8")
        assert "target={waypoint}" in page
