from __future__ import annotations

import base64
import json
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from console_records import (
    HOSTILE,
    LIFT_OFF_S,
    VIOLATED,
    Story,
    execution,
    failing_story,
    lost_video,
    transition,
    tree,
    write_map,
    write_record,
)
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as stn

from alula.common.record import DATA, EVENTS, FILE, MISSION, OPERATOR, REPORTS, TICKS, TREE, Entry
from alula.common.robots import RobotError, load_robot_folder
from alula.common.run_log import PICTURES_FILE, note_act
from alula.console.feed import CHUNK_BYTES, Feed, Place, place_of
from alula.report.page.areas import areas_of
from alula.report.page.clouds import MAX_POINTS, CloudError, packed, read_points, thinned
from alula.report.page.embedded import REPORT, entries_inside, read_report
from alula.report.page.entries import AREAS, CAUSES, HEALTH, MAP, NODES, PATH, PICTURE, ROUTE, RUN, SUMMARY, Converter, Wire
from alula.report.page.following import RunFollower
from alula.report.page.writing import MAX_PICTURES, PARTS, make_page, write_report


def entry(topic: str, t_s: float, value: dict[str, object]) -> Entry:
    return Entry(topic, round(t_s * 1e9), value)


def test_a_tree_is_sent_once_and_then_what_changed() -> None:
    converter = Converter()
    first = list(converter.convert(entry(TREE, 1.0, tree("RUNNING", "INVALID"))))
    again = list(converter.convert(entry(TREE, 2.0, tree("RUNNING", "INVALID"))))
    failed = list(converter.convert(entry(TREE, 3.0, tree("FAILURE", "RUNNING"))))
    assert first[0][:2] == (TREE, 1.0)
    assert first[0][2] == [
        (0, "selector", "navigate", "", "", ""),
        (1, "parallel", "ZED navigation", "", "", ""),
        (2, "skill", "watch with the ZED", "perception.zed_depthmap", "", ""),
        (1, "sequence", "LiDAR navigation", "", "", ""),
        (2, "skill", "watch with the LiDAR", "perception.lidar_depthmap", "", ""),
    ]
    assert first[1] == (NODES, 1.0, [[0, "RUNNING", ""], [1, "RUNNING", ""], [2, "RUNNING", ""]])
    assert again == []
    assert failed == [(NODES, 3.0, [[1, "FAILURE", ""], [2, "FAILURE", "zed_ok"], [3, "RUNNING", ""], [4, "RUNNING", ""]])]


def test_a_node_of_a_file_tells_what_the_file_says_of_it() -> None:
    source = {"type": "navigation.goto", "ports": {"target": "{waypoint}"}, "conditions": {"_skipIf": "near"}, "place": "mapping.xml:12"}
    view = {"name": "there", "kind": "skill", "skill": "navigation.goto", "status": "RUNNING", **source}
    told = "navigation.goto  target={waypoint}  _skipIf: near"
    found = next(iter(Converter().convert(entry(TREE, 1.0, view))))
    assert found[2] == [(0, "skill", "there", "navigation.goto", told, "mapping.xml:12")]


def test_a_tree_of_another_shape_is_sent_whole() -> None:
    converter = Converter()
    list(converter.convert(entry(TREE, 1.0, tree("RUNNING", "INVALID"))))
    assert [wire[0] for wire in converter.convert(entry(TREE, 2.0, tree("RUNNING", "INVALID", name="aborted")))] == [TREE, NODES]


@pytest.mark.parametrize("view", [{}, {"children": 3}, {"children": [1, None, "x"], "name": None}, {"status": 7, "name": ["a"]}])
def test_a_tree_that_makes_no_sense_is_some_tree(view: dict[str, object]) -> None:
    assert [wire[0] for wire in Converter().convert(entry(TREE, 1.0, view))][:1] == [TREE]


def test_samples_of_each_data_come_five_times_a_second_at_most() -> None:
    converter = Converter()
    sent = [
        t
        for t in range(100)
        for name in ("a", "b")
        for _ in converter.convert(entry(DATA, 1 + t / 20, {"skillset": "s", "data": name, "value": {}}))
    ]
    assert sent == [t for t in range(0, 100, 4) for _ in range(2)]


def test_ticks_come_when_what_the_mission_needs_to_start_has_changed_and_reports_never() -> None:
    converter = Converter()
    ticks: list[dict[str, object]] = [{"unmet": ["no GPS"], "conditions": [["GPS", "no GPS"]]}] * 2
    ticks += [{"unmet": [], "conditions": [["GPS", ""]]}] * 2 + [{"unmet": []}] * 2
    assert [list(converter.convert(entry(REPORTS, 1.0, {}))) for _ in range(2)] == [[], []]
    sent = [t for t, tick in enumerate(ticks) for _ in converter.convert(entry(TICKS, float(t), tick))]
    assert sent == [0, 2, 4]


# --- clouds --------------------------------------------------------------------------------------------------------------


@given(stn.arrays(np.float64, st.tuples(st.integers(1, 50), st.just(3)), elements=st.floats(-300, 300)))
def test_packed_points_are_where_they_were(points: np.ndarray) -> None:
    cloud = packed(points)
    numbers = np.frombuffer(base64.b64decode(cloud["data"]), "<u2").reshape(-1, 3)
    unpacked = np.asarray(cloud["origin_m"]) + cloud["step_m"] * numbers
    assert (cloud["count"], cloud["of"]) == (len(points), len(points))
    assert np.abs(unpacked - points).max() <= cloud["step_m"] / 2 + 0.0006  # the origin is told in millimetres


def test_many_points_are_thinned_evenly() -> None:
    dense = np.random.default_rng(0).random((200_000, 3)) * [30, 30, 3]
    kept = thinned(dense)
    assert 5000 < len(kept) <= MAX_POINTS
    counts, _, _ = np.histogram2d(kept[:, 0], kept[:, 1], bins=6)
    assert counts.min() > 0.8 * counts.mean()


def test_clouds_that_can_not_be_read_are_named(tmp_path: Path) -> None:
    good = tmp_path / "good.ply"
    write_map(good, 10)
    assert read_points(good).shape == (10, 3)
    for content, why in (
        (b"", "line 1: expected 'ply'"),
        (b"\xff\xfe\n", ".*can't decode byte"),
        (b"ply\nformat ascii 1.0\nend_header\n", "has no vertex"),
        (b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float q\nend_header\n0\n", "no field of name x"),
        (good.read_bytes()[:-5], ".*early end-of-file"),
    ):
        (tmp_path / "bad.ply").write_bytes(content)
        with pytest.raises(CloudError, match=f"bad.ply: {why}"):
            read_points(tmp_path / "bad.ply")


# --- following -----------------------------------------------------------------------------------------------------------


def test_a_run_is_followed_while_it_grows(tmp_path: Path) -> None:
    follower, story = RunFollower(tmp_path), failing_story()
    assert follower.poll() == []
    writer = write_record(tmp_path, story[:3], over=False)
    (tmp_path / "run.json").write_text('{"scenario": "mapping", "world": "/a/b/yard.yaml", "run_id": "x"}', encoding="utf-8")
    first = follower.poll()
    assert [wire[0] for wire in first] == [RUN, AREAS, ROUTE, "/mission", TREE, NODES, EVENTS, CAUSES]
    assert (first[0][1], first[0][2]["world"], "run_id" in first[0][2]) == (None, "yard", False)  # type: ignore[index, operator]
    assert follower.poll() == []
    writer.write(EVENTS, 1, {"kind": "x"})
    note_act(tmp_path, 20.0, {"command": "abort", "by": "me"})
    assert [(wire[0], wire[1]) for wire in follower.poll()] == [(EVENTS, 0.0), (OPERATOR, 20.0)]
    writer.close()
    assert follower.problems == []


def causes_in(entries: Iterable[tuple[str, float | None, object]]) -> Any:
    return [value for topic, _, value in entries if topic == CAUSES][-1]


@pytest.mark.parametrize("story", [failing_story(), lost_video()])
def test_a_live_page_is_told_the_causes_that_the_report_holds(tmp_path: Path, story: Story) -> None:
    told = [(topic, t_s, value) for t_s, topic, value in story if topic == "/fault"]
    story = [entry for entry in story if entry[1] != "/fault"]
    (tmp_path / "run.json").write_text(json.dumps({"faults": ["zed@30", "ground_station:killed@40"]}), encoding="utf-8")
    writer, follower, seen = write_record(tmp_path, story[:2], over=False), RunFollower(tmp_path), []
    for t_s, topic, value in story[2:]:
        writer.write(topic, round(t_s * 1e9), {**value, "stamp_s": t_s} if topic == EVENTS else value)
        seen += [entry for entry in follower.poll() if entry[0] == CAUSES]
    writer.close()
    steps = [len(value["failures"]) for _, _, value in seen]  # type: ignore[index]
    assert steps == sorted(steps), "a failure is told when it happens, with what is known by then"
    assert steps[0] == 0
    write_report(tmp_path, told, title="x")
    reported = causes_in(read_report(tmp_path / REPORT))
    live = causes_in(seen)
    assert live == reported
    (behind,) = {failure["fault"] for failure in live["failures"]} - {None}
    assert live["faults"][behind]["name"] == ("ground_station" if told else "zed")
    assert all(failure["chain"] for failure in live["failures"])


def test_a_summary_decides_which_fault_a_failure_follows_from(tmp_path: Path) -> None:
    write_record(tmp_path, failing_story())
    lidar = {"sensor": "lidar", "mode": "", "injected": False, "t_s": 29.0, "until_s": 31.0, "detected_s": 30.0, "failed": ["zed_de"]}
    summary = {"answers": [lidar], "lift_off": {"stamp_s": LIFT_OFF_S}}
    (tmp_path / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    causes = causes_in(RunFollower(tmp_path).poll())
    (fault,), (failure,) = causes["faults"], causes["failures"]
    assert (fault["text"], fault["t"], fault["until"]) == ("lidar was lost", LIFT_OFF_S + 29, LIFT_OFF_S + 31)
    assert failure["fault"] == 0
    assert (causes["departed_s"], causes["back_s"]) == (LIFT_OFF_S, None)


def test_a_page_opened_later_reads_the_causes_in_the_summary_and_makes_those_of_an_older_one(tmp_path: Path) -> None:
    write_record(tmp_path, failing_story())
    (tmp_path / "run.json").write_text(json.dumps({"faults": ["zed@30"]}), encoding="utf-8")
    older = {"outcome": "degraded"}
    (tmp_path / "summary.json").write_text(json.dumps(older), encoding="utf-8")
    explained = write_report(tmp_path, title="x")
    assert explained == causes_in(RunFollower(tmp_path).poll()) == causes_in(read_report(tmp_path / REPORT))
    assert [failure["skill"] for failure in explained["failures"]] == ["zed_depthmap"]
    kept = {**explained, "failures": [{**explained["failures"][0], "text": "as it was told when the run ended"}]}
    (tmp_path / "summary.json").write_text(json.dumps({**older, "causes": kept}), encoding="utf-8")
    entries = RunFollower(tmp_path).poll()
    assert causes_in(entries) == kept, "what the summary says is derived again by nobody"
    assert [value for topic, _, value in entries if topic == SUMMARY] == [older]


def test_a_report_says_the_summary_that_it_is_given_whatever_is_in_the_folder(tmp_path: Path) -> None:
    write_record(tmp_path, failing_story())
    (tmp_path / "run.json").write_text(json.dumps({"faults": ["zed@30"]}), encoding="utf-8")
    kept = {"departed_s": None, "back_s": None, "faults": [], "failures": []}
    (tmp_path / "summary.json").write_text(json.dumps({"outcome": "running", "causes": kept}), encoding="utf-8")
    explained = write_report(tmp_path, title="x", summary={"outcome": "degraded", "problems": ()})
    entries = read_report(tmp_path / REPORT)
    assert [value for topic, _, value in entries if topic == SUMMARY] == [{"outcome": "degraded", "problems": []}]
    assert causes_in(entries) == explained
    assert [failure["skill"] for failure in explained["failures"]] == ["zed_depthmap"]


def test_the_page_is_told_what_is_bad_news_and_why_and_looks_at_no_names(tmp_path: Path) -> None:
    changes = [("perception.zed_status", "BROKEN"), ("perception.zed_status", "OK"), ("rover.arm", "BROKEN"), ("video.link", "DOWN")]
    story = [(1.0, EVENTS, transition(resource, "X", state)) for resource, state in changes]
    low = execution("video.stream", VIOLATED, 9, result="good", message="good: picture.fps_margin is -6 for 1 s")
    write_record(tmp_path, [*story, (2.0, EVENTS, low), (3.0, "/mission", {"reason": "video.stream: FAILED x (no (real) link)"})])
    values: list[Any] = [value for topic, _, value in RunFollower(tmp_path).poll() if topic in {EVENTS, "/mission"}]
    assert [value.get("alarm") for value in values] == ["always", "", "", "always", None, None]
    assert values[4]["why"] == "frames per second: 6 below the limit for 1 s"
    assert values[5]["told"] == "video.stream: no (real) link (failed x)"
    program = "".join(path.read_text(encoding="utf-8") for path in PARTS.glob("*.js"))
    assert not re.search(r"BROKEN|LOST|UNAVAILABLE|_margin is|flight_status|SDK_authority", program)


def test_a_long_record_is_read_in_pieces(tmp_path: Path) -> None:
    write_record(tmp_path, [(float(number), EVENTS, {"number": number}) for number in range(25)])
    follower, read = RunFollower(tmp_path), []
    while piece := follower.poll(10):
        read.append((len(piece), follower.behind))
    assert read == [(10, True), (10, True), (5, False)]
    assert len(RunFollower(tmp_path).poll()) == 25


def test_files_that_are_damaged_are_told_and_the_rest_is_read(tmp_path: Path) -> None:
    write_record(tmp_path, failing_story())
    for name, content in (
        ("run.json", "[1]"),
        ("map.ply", "ply"),
        ("run_log.jsonl", "{\n[]\n1\n"),
    ):
        (tmp_path / name).write_text(content, encoding="utf-8")
    follower = RunFollower(tmp_path)
    topics = {wire[0] for wire in follower.poll()}
    assert EVENTS in topics
    assert topics.isdisjoint({RUN, MAP, OPERATOR})
    assert [problem.partition(":")[0] for problem in follower.problems] == ["run.json", "map.ply"]


@pytest.mark.parametrize("route", [[["x", 1, 2]], [[1, 2]], 3, [[1, 2, None]]])
def test_the_route_is_among_the_missions_inputs_once(route: object) -> None:
    good = Entry(MISSION, 1, {"outcome": "running", "inputs": {"route": [[0, 0, 3], [6, 1, 3]]}})
    converter = Converter()
    assert [wire[0] for wire in converter.convert(good)] == [ROUTE, MISSION]
    assert [wire[0] for wire in converter.convert(good)] == [MISSION]
    for inputs in ({"route": route}, route, None):
        assert [wire[0] for wire in Converter().convert(Entry(MISSION, 1, {"outcome": "running", "inputs": inputs}))] == [MISSION]


def test_a_file_that_is_no_record_is_told(tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(b"something else")
    follower = RunFollower(tmp_path)
    assert follower.poll() == []
    assert "is no MCAP" in follower.problems[0]


# --- areas ---------------------------------------------------------------------------------------------------------------


def world_file(path: Path, zones: object) -> str:
    path.write_text(yaml.safe_dump({"name": "w", "radio_zones": zones}), encoding="utf-8")
    return str(path)


def test_areas_of_every_shape_are_told(tmp_path: Path) -> None:
    box = {"name": HOSTILE, "quality": "degraded", "box": {"low": [0, 0, 0], "high": [1, 2, 3]}}
    cylinder = {"name": "mast", "quality": "good", "cylinder": {"at": [1, 2], "radius_m": 5, "z": [0, 20]}}
    sphere = {"name": "jammer", "quality": "critical", "sphere": {"at": [4, 5, 6], "radius_m": 8}}
    world = world_file(tmp_path / "w.yaml", [box, cylinder, sphere])
    (tmp_path / "run.json").write_text(json.dumps({"scenario": "mapping", "world": world}), encoding="utf-8")
    follower = RunFollower(tmp_path)
    areas = {wire[0]: wire[2] for wire in follower.poll()}[AREAS]
    told = [("radio degraded", "fair"), ("radio good", "good"), ("radio critical", "bad")]
    zones = [{name: value for name, value in zone.items() if name != "quality"} for zone in (box, cylinder, sphere)]
    assert areas == [{**zone, "told": text, "tone": tone} for zone, (text, tone) in zip(zones, told, strict=True)]
    assert follower.poll() == []
    assert areas_of("") == areas_of("/not/here.yaml") == []


@pytest.mark.parametrize(
    "zones",
    [3, ["a"], [{}], [{"name": "a", "quality": "good"}], [{"name": "a", "quality": "good", "box": {"low": [1], "high": [1, 2, 3]}}]],
)
def test_zones_that_make_no_sense_are_told(tmp_path: Path, zones: object) -> None:
    world = world_file(tmp_path / "w.yaml", zones)
    (tmp_path / "run.json").write_text(json.dumps({"scenario": "mapping", "world": world}), encoding="utf-8")
    follower = RunFollower(tmp_path)
    assert [wire[0] for wire in follower.poll()] == [RUN]
    assert follower.problems[0].startswith("run.json: ")


# --- pictures ------------------------------------------------------------------------------------------------------------


def add_pictures(folder: Path, count: int, cameras: tuple[str, ...] = ("depth", "screen")) -> None:
    with (folder / PICTURES_FILE).open("a", encoding="ascii") as file:
        for number in range(count):
            for camera in cameras:
                file.write(
                    json.dumps({"stamp_s": number + 1, "camera": camera, "jpeg": base64.b64encode(os.urandom(6000)).decode()}) + "\n"
                )


def test_pictures_are_followed_while_they_come(tmp_path: Path) -> None:
    follower = RunFollower(tmp_path)
    add_pictures(tmp_path, 2)
    (tmp_path / PICTURES_FILE).open("a").write('{"stamp_s": 3, "cam')
    assert [(wire[0], wire[1]) for wire in follower.poll()] == [(PICTURE, 1.0)] * 2 + [(PICTURE, 2.0)] * 2
    assert follower.poll() == []


def test_a_report_holds_some_pictures_of_each_camera_and_stays_small(tmp_path: Path) -> None:
    add_pictures(tmp_path, 1500)
    write_report(tmp_path, title="long")
    page = (tmp_path / REPORT).read_text(encoding="utf-8")
    shown = [(entry[1], entry[2]["camera"]) for entry in entries_inside(page) if entry[0] == PICTURE]  # type: ignore[index]
    for camera in ("depth", "screen"):
        times = [t_s for t_s, name in shown if name == camera]
        assert 150 < len(times) <= MAX_PICTURES / 2
        assert np.diff(times).max() == np.diff(times).min()  # type: ignore[arg-type]
    assert len(page) < 10e6


# --- the page ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("damage", ["H4sI", "no base64!", ""])
def test_what_other_recordings_tell_is_followed_out_of_the_report(tmp_path: Path, damage: str) -> None:
    path: Wire = (PATH, 3.0, [1.0, 2.0, 3.0])
    health: Wire = (HEALTH, 2.0, {"sensor": "zed", "ok": False})
    add_pictures(tmp_path, 2)
    follower = RunFollower(tmp_path)
    assert {topic for topic, _, _ in follower.poll()} == {PICTURE}
    for _ in range(2):  # a report that is made again tells them once
        write_report(tmp_path, [path, health], title="over")
    assert sorted(entry for entry in read_report(tmp_path / REPORT) if entry[0] != PICTURE) == [health, path]
    assert sorted(follower.poll()) == [health, path]
    assert follower.poll() == []
    (tmp_path / REPORT).write_text(f'<script id="record">{damage}</script>' if damage else "<p>", encoding="utf-8")
    damaged = RunFollower(tmp_path)
    assert {topic for topic, _, _ in damaged.poll()} == {PICTURE}
    assert [problem.partition(":")[0] for problem in damaged.problems] == [REPORT]


def test_a_report_holds_the_run_and_fetches_nothing(tmp_path: Path) -> None:
    write_record(tmp_path, failing_story())
    write_report(tmp_path, [("/fault", 42.0, {"sensor": "zed", "mode": "dead"})], title="mapping, seed 1")
    page = (tmp_path / REPORT).read_text(encoding="utf-8")
    entries = entries_inside(page)
    times = [t for _, t, _ in entries if t is not None]
    assert times == sorted(times)  # type: ignore[type-var]
    assert ("/fault", 42.0, {"sensor": "zed", "mode": "dead"}) in entries
    assert "connect-src &#x27;none&#x27;" in page
    assert not re.search(r"(src|href)=\"(https?:)?//", page)
    assert "http://www.w3.org/2000/svg" in page  # a name, no address: the only one
    assert set(re.findall(r"https?://[^\"' ]+", page)) == {"http://www.w3.org/2000/svg"}


def test_markup_of_a_run_is_no_markup_of_the_page() -> None:
    page = make_page(title=HOSTILE, entries=[("/run", None, {"name": HOSTILE, "nan": float("nan")})])
    assert "<img" not in page
    assert page.count("</script>") == 2
    assert entries_inside(page) == [("/run", None, {"name": HOSTILE, "nan": None})]


# --- feeds ---------------------------------------------------------------------------------------------------------------


def test_a_viewer_is_sent_what_it_lacks(tmp_path: Path) -> None:
    write_record(tmp_path, failing_story())
    feed, place = Feed(tmp_path), Place()
    feed.add(feed.read())
    first = json.loads(feed.message(place) or "")
    assert (first["reset"], first["upTo"], first["session"]) == (True, first["of"], feed.session)
    assert feed.message(place) is None
    note_act(tmp_path, 99.0, {"command": "abort"})
    feed.add(feed.read())
    second = json.loads(feed.message(place) or "")
    assert (second["reset"], second["entries"]) == (False, [[OPERATOR, 99.0, {"stamp_s": 99.0, "command": "abort"}]])
    back = json.loads(feed.message(place_of({"session": feed.session, "entries": first["upTo"]})) or "")
    assert [wire[0] for wire in back["entries"]] == [ROUTE, CAUSES, OPERATOR]
    assert json.loads(feed.message(place_of({"session": "of another life", "entries": 5})) or "")["reset"] is True


def test_a_long_run_comes_in_pieces(tmp_path: Path) -> None:
    feed, place = Feed(tmp_path), Place()
    feed.add((EVENTS, number / 10, json.dumps([EVENTS, number / 10, "x" * (CHUNK_BYTES // 4)])) for number in range(9))
    pieces = []
    while (text := feed.message(place)) is not None:
        pieces.append(len(json.loads(text)["entries"]))
    assert pieces == [4, 4, 1]


@pytest.mark.parametrize("hello", [{}, {"session": 3, "entries": 1}, {"session": "a", "entries": -1}, {"session": "a", "entries": True}])
def test_a_place_that_makes_no_sense_is_the_beginning(hello: dict[str, object]) -> None:
    assert place_of(hello) == Place()


def test_a_robot_that_says_nothing_of_its_page_has_no_fence_and_usual_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "robot.yaml").write_text("name: rover\n", encoding="utf-8")
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path))
    (tmp_path / "world.yaml").write_text("radio_zones: 3\n", encoding="utf-8")
    assert areas_of(str(tmp_path / "world.yaml")) == []
    (tmp_path / "run.json").write_text("{}", encoding="utf-8")
    words = next(value["words"] for topic, _, value in RunFollower(tmp_path).poll() if topic == RUN)
    assert [words[name] for name in ("departure", "away", "back", "moved")] == ["departure", "under way", "back", "travelled"]
    assert words["fence"] is None
    assert words["modes"] == words["live"] == words["glossary"] == {}
    (tmp_path / "robot.yaml").write_text("name: rover\npage:\n  away: out\n  fence: [5, 0]\n", encoding="utf-8")
    with pytest.raises(RobotError, match=r"robot.yaml:4.*radius, floor, ceiling"):
        load_robot_folder(tmp_path)
