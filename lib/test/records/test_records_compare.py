"""Runs side by side: the same flight twice is alike, a failure is told at the first decision that it changes, many make distributions."""

from __future__ import annotations

import json
import shutil
from xml.etree import ElementTree as ET

import pytest

from alula.campaign.mocked_scenarios import load_mocked_scenario
from alula.cli.compare import main
from alula.common import run_log
from alula.common.faults import parse_fault
from alula.common.robots import find_robot
from alula.records.comparing import ComparedDecision, Side, compare
from alula.records.comparing.rendering import lines, spread
from alula.runtime.core.events import event_record


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    flights, base, found = load_mocked_scenario("mapping"), tmp_path_factory.mktemp("runs"), {}
    for name, fault in (("nominal", ""), ("again", ""), ("zed-fails", "zed@30")):
        flown = flights.run([parse_fault(fault)] if fault else [])
        folder = found[name] = base / name
        folder.mkdir()
        lines = "".join(json.dumps(event_record(event)) + "\n" for event in flown.events)
        (folder / "events.jsonl").write_text(lines, encoding="utf-8")
        (folder / "run.json").write_text(json.dumps({"robot": str(find_robot().root)}), encoding="utf-8")
        run_log.note(folder, run_log.MISSION, {"outcome": flown.end.outcome.value})
    summary = {"duration_s": 100.0, "recovery": {"failure_s": 30.0, "detected_s": 30.5}, "map": {"coverage": 0.9}, "video": None}
    (found["zed-fails"] / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    return found


def test_the_same_flight_twice_is_decided_alike(folders, capsys):
    assert main([str(folders["nominal"]), str(folders["again"])]) == 0
    assert "same decisions: " in capsys.readouterr().out


def test_another_flight_is_told_with_its_first_other_decision_and_its_figures(folders, capsys, tmp_path):
    picture = tmp_path / "c.svg"
    assert main([*(str(folders[name]) for name in ("nominal", "again", "zed-fails")), "--svg", str(picture)]) == 1
    said = capsys.readouterr().out
    assert "interrupt navigation.goto_straight at 30.3" in said
    assert said.splitlines()[0].split() == ["nominal", "again", "zed-fails"]
    assert any(line.split()[-1] == "0.500" for line in said.splitlines() if line.startswith("detected after (s)"))
    text = "".join(ET.parse(picture).getroot().itertext())  # noqa: S314 - our own
    assert "zed-fails: degraded" in text
    assert "perception.lidar_depthmap" in text


def decided(name, *decisions):
    return Side(name, "degraded", [ComparedDecision(what, at_s) for what, at_s in decisions], [], {}, {})


FIRST = decided("first", ("start a.x", 1.0), ("start b.y", 2.0), ("interrupt a.x", 9.0), ("start a.x", 10.0))


@pytest.mark.parametrize(
    ("decisions", "at", "told"),
    [
        ([("start b.y", 1.4), ("start a.x", 1.6), ("interrupt a.x", 9.9), ("start a.x", 10.9)], None, ""),
        ([("start a.x", 1.0), ("start b.y", 2.0), ("interrupt a.x", 10.1), ("start a.x", 10.2)], 2, "interrupt a.x at 10.10 s in other"),
        ([("start a.x", 1.0), ("start b.y", 2.0), ("interrupt a.x", 9.0)], 3, "start a.x at 10.00 s in first; nothing more in other"),
        ([*((one.what, one.at_s) for one in FIRST.decisions), ("start c.z", 11.0)], 4, "nothing more in first; start c.z at 11.00 s"),
        ([("start a.x", 0.0), ("start a.x", 1.0), ("start b.y", 2.0), ("interrupt a.x", 9.0)], 3, "start a.x at 10.00 s in first"),
        ([], 0, "start a.x at 1.00 s in first; nothing more in other"),
    ],
    ids=["places", "late", "missing", "more", "earlier", "none"],
)
def test_decisions_within_seconds_may_change_places(decisions, at, told):
    """The k-th time that something is decided is held against the k-th time in the first run."""
    compared = compare([FIRST, decided("other", *decisions)], 1.0)
    assert [one and one.at for one in compared.differences] == [at]
    assert told in "\n".join(lines(compared))
    assert compare([FIRST, FIRST], 0.0).alike


def test_the_command_takes_seconds(folders, capsys):
    pair = [str(folders["nominal"]), str(folders["again"])]
    assert main([*pair, "--within", "0.5"]) == 0
    assert "same decisions within 0.5 s: " in capsys.readouterr().out
    assert main([str(folders["nominal"]), str(folders["zed-fails"]), "--within", "0.5", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["within_s"] == 0.5
    with pytest.raises(SystemExit, match="2"):
        main([*pair, "--within", "nan"])


def test_json_has_every_figure_and_decision(folders, capsys):
    assert main([str(folders["nominal"]), str(folders["zed-fails"]), "--json"]) == 1
    (line,) = capsys.readouterr().out.splitlines()
    told = json.loads(line)
    assert (told["alike"], [side["outcome"] for side in told["runs"]]) == (False, ["accomplished", "degraded"])
    assert told["runs"][1]["figures"]["map coverage"] == 0.9
    assert told["runs"][0]["decisions"][0]["what"] == "start navigation.takeoff"
    at = told["differs_at"][0]
    assert told["runs"][0]["decisions"][:at] != told["runs"][1]["decisions"][: at + 1]
    assert told["distributions"]["duration"]["min"] == 100.0


def test_many_runs_are_told_as_distributions(folders, capsys, tmp_path):
    picture = tmp_path / "c.svg"
    assert main([*([str(folders["nominal"])] * 6), str(folders["zed-fails"]), "--svg", str(picture)]) == 1
    said = capsys.readouterr().out
    assert said.splitlines()[0].split() == ["7", "runs", "min", "median", "p95", "max"]
    assert "outcomes: 6 accomplished, 1 degraded" in said
    assert "7 runs; a stroke a run" in "".join(ET.parse(picture).getroot().itertext())  # noqa: S314 - our own


@pytest.mark.parametrize(("values", "p95"), [([3.0], 3.0), (list(range(1, 101)), 95), (list(range(1, 21)), 19), ([1, 2, 3], 3)])
def test_the_95th_percentile_is_what_95_in_100_do_not_exceed(values, p95):
    assert spread(values)["p95"] == p95


IMPOSSIBLE = ['{"recovery": {"failure_s": "x", "detected_s": 1}}', '{"recovery": [1]}', '{"duration_s": {}}', '{"map": 3}', "[]", "null"]


@pytest.mark.parametrize("summary", IMPOSSIBLE)
def test_figures_that_can_not_be_are_left_out(summary, folders, capsys, tmp_path):
    damaged = shutil.copytree(folders["nominal"], tmp_path / "damaged")
    (damaged / "summary.json").write_text(summary, encoding="utf-8")
    assert main([str(folders["nominal"]), str(damaged), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["runs"][1]["figures"]["detected after"] is None


@pytest.mark.parametrize("summary", ["{", "[" * 10**5, "\x00"], ids=["cut", "deep", "nul"])
def test_a_summary_that_is_no_json_is_refused_in_a_line(summary, folders, capsys, tmp_path):
    damaged = shutil.copytree(folders["nominal"], tmp_path / "damaged")
    (damaged / "summary.json").write_text(summary, encoding="utf-8")
    assert main([str(folders["nominal"]), str(damaged)]) == 2
    said = capsys.readouterr().err
    assert f"{damaged / 'summary.json'}: can't be read" in said
    assert said.count("\n") == 1


def test_what_can_not_be_compared_is_refused(folders, capsys, tmp_path):
    assert main([str(folders["nominal"]), str(tmp_path)]) == 2
    assert "is no run and no bag" in capsys.readouterr().err
    assert main([str(folders["nominal"]), str(folders["again"]), "--svg", str(tmp_path / "x.none")]) == 2
    assert "alula compare: " in capsys.readouterr().err
    picture = tmp_path / "no" / "x.svg"
    assert main([str(folders["nominal"]), str(folders["again"]), "--svg", str(picture)]) == 2
    assert capsys.readouterr().err == f"alula compare: --svg {picture}: can't be written: No such file or directory\n"
    with pytest.raises(SystemExit, match="2"):
        main([str(folders["nominal"])])
