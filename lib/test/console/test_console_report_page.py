"""The report of a run in a browser: the same page, with the run's entries in the file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from console_page import DRAWN, SIZES, UNNAMED, Page
from console_records import HOSTILE, LIFT_OFF_S, Story, execution, failing_story, lost_video, transition, tree
from console_reports import SUMMARY, make_report, make_story_report

from alula.common.record import EVENTS, MISSION, OPERATOR, TREE
from alula.report.page.embedded import REPORT
from alula.report.page.writing import write_report

ANSWERS = (
    "[...document.querySelectorAll('#answers tbody tr')].map((row) => [...row.children].map((cell) =>"
    "(cell.tagName === 'TH' ? cell.firstChild : cell).textContent).join(' | '))"
)
"""The rows of what failed, when, what was done, what it cost, what could have been done."""


def test_the_report_says_what_failed_when_what_was_done_and_what_it_cost(browser: Any, tmp_path: Path) -> None:
    page = Page(browser, make_report(tmp_path))
    page.wait(DRAWN)
    assert page.text("#headline") == "Mission accomplished in degraded mode"
    assert page.text("#reason") == "zed failed (dead, injected) at 29.90 s"
    assert "The zed was made to fail (dead)." in page.text("#lines")
    assert "perception.zed_depthmap was stopped, its invariant zed_ok was violated: zed_status is BROKEN." in page.text("#lines")
    assert "29.80 sThe process zed_depth died: signal 11." in page.text("#lines li")
    steps = page.text(".chain li").split(" | ")
    assert [step.partition("2")[0] for step in steps[:1]] == ["failure"]
    chain = page.text(".chain b").split(" | ")
    assert chain == ["failure", "measurement", "resource", "invariant", "skill", "branch", "decision", "started"]
    assert "zed is silent: no image for 0.4 s" in steps[1]
    assert "perception.zed_status: OK → BROKEN, reported by the functional layer" in steps[2]
    assert "“ZED navigation” failed" in steps[5]
    assert "“navigate” went on with “LiDAR navigation”" in steps[6]
    rows = [row.split(" | ") for row in page.run(ANSWERS)]
    assert [row[:2] for row in rows] == [["zed failed (dead, injected)", "29.90 s"], ["the whole mission", ""]]
    assert "the mission fell back from “ZED navigation” to “LiDAR navigation”; started lidar_depthmap" in rows[0][2]
    assert rows[0][3] == "noticed after 0.10 s; the fallback ran after 0.60 s; the robot moved on after 4.10 s"
    assert rows[0][4].strip() == "alula repair missions/mapping.xml --fault zed"
    assert rows[1][2:] == ["mission accomplished in degraded mode; landed", "no waypoint was missed; nothing was hit", ""]
    assert page.complaints() == []


def test_the_slider_moves_tree_timeline_map_and_figures_together(browser: Any, tmp_path: Path) -> None:
    page = Page(browser, make_report(tmp_path))
    page.wait(DRAWN)
    page.choose(10.0)
    assert (page.status("watch with the ZED"), page.status("watch with the LiDAR")) == ("RUNNING", "INVALID")
    assert "east 10.0 m" in page.text("#map-words")
    assert page.text("#now") == "10.0 s"
    early = page.run("Number(document.querySelector('#timeline .cursor').getAttribute('x1'))")
    assert "50 m" in page.text("#charts figcaption")
    page.choose(40.0)
    assert (page.status("watch with the ZED"), page.status("watch with the LiDAR")) == ("FAILURE", "RUNNING")
    assert "east 40.0 m" in page.text("#map-words")
    assert page.run("Number(document.querySelector('#timeline .cursor').getAttribute('x1'))") > early
    assert "20 m" in page.text("#charts figcaption")


def test_the_map_shows_zones_of_the_radio_and_the_fence(browser: Any, tmp_path: Path) -> None:
    zones = [
        {"name": HOSTILE, "quality": "critical", "box": {"low": [8, 0, 0], "high": [12, 2, 9]}},
        {"name": "mast", "quality": "degraded", "cylinder": {"at": [10, 1], "radius_m": 12, "z": [0, 9]}},
        {"name": "jammer", "quality": "degraded", "sphere": {"at": [50, 1, 3], "radius_m": 5}},
    ]
    (tmp_path / "world.yaml").write_text(json.dumps({"radio_zones": zones}), encoding="utf-8")
    page = Page(browser, make_report(tmp_path, world=str(tmp_path / "world.yaml")))
    page.wait(DRAWN)
    words = {}
    for t_s in (10.0, 15.0, 30.0, 50.0):
        page.choose(t_s)
        words[t_s] = page.text("#map-words")
    assert f"In “{HOSTILE}”: radio critical." in words[10.0]  # the first that is listed counts
    assert "In “mast”: radio degraded." in words[15.0]
    assert ": radio" not in words[30.0]
    assert "In “jammer”: radio degraded." in words[50.0]
    assert "Fence: 60 m around home, 10.0 m away." in words[50.0]
    legend = page.text("#map-legend li").split(" | ")
    assert [text for text in legend if "radio" in text or "fence" in text] == ["radio critical", "radio degraded", "fence"]
    page.run("document.querySelector('#map-3d').click()")
    assert page.complaints() == []


EDGES = """(() => {
  const [canvas, wanted] = [document.querySelector('#map'), document.createElement('canvas').getContext('2d')];
  wanted.fillStyle = getComputedStyle(document.documentElement).getPropertyValue('--edge').trim();
  wanted.fillRect(0, 0, 1, 1);
  const edge = wanted.getImageData(0, 0, 1, 1).data;
  const { data, width } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  const found = [];
  for (let at = 0; at < data.length; at += 4) {
    if (data[at + 3] > 99 && [0, 1, 2].every((i) => Math.abs(data[at + i] - edge[i]) < 9)) found.push((at / 4) % width);
  }
  return [Math.min(...found), Math.max(...found), width];
})()"""
"""The first and the last column of the map in which there is a surface, and how many columns it has."""


def test_a_flat_robot_has_a_map_of_its_whole_floor_and_no_heights(browser: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "robot.yaml").write_text("name: rover\npage: {flat: true}\n", encoding="utf-8")
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path))
    wall = ("/world", None, [[-40.0, -2.0, 0.0, 90.0, -2.0, 0.0]])
    page = Page(browser, make_report(tmp_path, recordings=[wall]))
    page.wait(DRAWN)
    page.choose(10.0)
    first, last, columns = page.run(EDGES)
    assert 0 < first < last < columns - 1
    assert last - first > 0.8 * columns
    assert "height" not in page.text("#map-words") + page.text("#charts figcaption") + page.text("#readings dt") + page.text("#map-legend")
    assert "ground speed" in page.text("#charts figcaption")
    assert not page.run("document.querySelector('#map-3d').checkVisibility()")
    drawn = page.run("document.querySelector('#map').toDataURL()")
    page.run("document.querySelector('#map').dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowDown' }))")
    assert page.run("document.querySelector('#map').toDataURL()") == drawn
    assert page.complaints() == []


def test_what_the_mission_was_sent_out_for_is_told_at_its_end(browser: Any, tmp_path: Path) -> None:
    tasks = [{"name": "a-b", "done": True, "why": ""}, {"name": HOSTILE, "done": False, "why": "the door is shut"}]
    page = Page(browser, make_story_report(tmp_path, failing_story(), {**SUMMARY, "tasks": tasks}))
    page.wait(DRAWN)
    assert page.text("#tasks li") == f"a-bdone | {HOSTILE}not done: the door is shut"
    assert "tasks done1 of 2" in page.text("#figures-row div")
    assert "1 of 2 tasks were not done" in page.text("#answers td")
    page.choose(10.0)  # under way
    assert page.run("document.querySelector('#tasks').hidden")
    assert page.complaints() == []


def test_pictures_and_the_figures_of_the_video_move_with_the_slider(browser: Any, tmp_path: Path) -> None:
    browser.get("about:blank")
    jpegs = browser.execute_script(
        "return ['#300', '#0c0'].map((colour) => { const canvas = document.createElement('canvas'); const pen = canvas.getContext('2d');"
        "pen.fillStyle = colour; pen.fillRect(0, 0, 300, 150); return canvas.toDataURL('image/jpeg').split(',')[1]; })"
    )
    lines = [
        json.dumps({"stamp_s": LIFT_OFF_S + t_s, "camera": camera, "jpeg": jpeg})
        for t_s, jpeg in zip((10.0, 20.0), jpegs, strict=True)
        for camera in ("depth", "screen", HOSTILE)
    ]
    lines.append(json.dumps({"stamp_s": LIFT_OFF_S + 11, "camera": "bad", "jpeg": "x' onerror='alert(1)"}))
    (tmp_path / "pictures.jsonl").write_text("\n".join(lines) + "\n", encoding="ascii")
    value = {"fps": 17.0, "quality": 0.93, "bit_rate_bps": 1.2e6, "delay_s": 0.21, "loss": 0.015}
    received = (LIFT_OFF_S + 9.0, "/data", {"skillset": "video", "data": "picture", "value": value, "stamp_s": 1.0})
    page = Page(browser, make_report(tmp_path, sorted([*failing_story(), received], key=lambda entry: entry[0])))
    page.wait("document.querySelectorAll('#pictures img[src]').length === 3")
    page.choose(5.0)
    assert page.text("#pictures figcaption b") == "no picture yet | no picture yet | no picture yet"
    assert page.run("document.querySelectorAll('#pictures img[src]').length") == 0
    page.choose(10.5)
    assert page.text("#pictures figcaption b").startswith("10.0 s | 10.0 s")
    assert "17 frames/s, 0.93 SSIM, 1200 kbit/s, 0.21 s delay, 1.5 % lost" in page.text("#pictures .hint")
    page.wait("document.querySelector('#pictures img').naturalWidth === 300")
    early = page.run("document.querySelector('#pictures img').src")
    page.choose(19.9)
    assert "10.0 s, 10 s old" in page.text("#pictures figcaption b")
    page.choose(21.0)
    assert page.run("document.querySelector('#pictures img').src") != early
    assert page.run("document.querySelector('#pictures img').alt").startswith("depth camera: near is yellow")
    assert page.complaints() == []


def test_a_failure_in_a_pause_is_told_with_what_was_done_when_the_mission_went_on(browser: Any, tmp_path: Path) -> None:
    later, story = 60.0, failing_story()
    moved = [(t_s + later if t_s >= LIFT_OFF_S + 30.5 else t_s, topic, value) for t_s, topic, value in story if topic != "/data"]
    told = [
        (t_s + later, topic, value) if (topic == TREE and t_s == LIFT_OFF_S + 30) else (t_s, topic, value) for t_s, topic, value in moved
    ]
    held = [
        (LIFT_OFF_S + t_s, OPERATOR, {"command": command, "by": "mission", "reason": reason})
        for t_s, command, reason in (
            (20.0, "pause", "all are asked"),
            (20.5, "paused", "navigation.goto holds"),
            (30.1, "paused", "navigation.goto holds; perception.zed_depthmap has ended"),
            (89.9, "resume", ""),
        )
    ]
    page = Page(browser, make_report(tmp_path, sorted([*told, *held], key=lambda entry: entry[0])))
    page.wait(DRAWN)
    chain = page.text(".chain b").split(" | ")
    assert chain[-3:] == ["branch", "decision", "started"]
    assert page.text("#lines li").count("The mission is paused") == 1
    rows = [row.split(" | ") for row in page.run(ANSWERS)]
    assert [row[0] for row in rows] == ["zed failed (dead, injected)", "the whole mission"], "a pause is no failure"
    assert "89.90 sThe mission goes on, after 69.9 s." in page.text("#lines li")
    assert "90.00 sReaction: the mission fell back from “ZED navigation” to “LiDAR navigation”" in page.text("#lines li")
    assert "paused 20.00 s" in page.text("#timeline text")
    assert "goes on 89.90 s" in page.text("#timeline text")
    assert page.complaints() == []


def test_a_vehicle_that_crashed_is_not_told_as_landed(browser: Any, tmp_path: Path) -> None:
    crashed = {"outcome": "given_up", "reason": "", "landed": False, "crash": "it met the ground at 7.0 m/s", "collisions": 1}
    page = Page(browser, make_story_report(tmp_path, lost_video(), crashed))
    page.wait(DRAWN)
    assert page.run(ANSWERS)[-1].split(" | ")[2] == "mission given up; crashed"
    assert "57.00 sCrashed: it met the ground at 7.0 m/s." in page.text("#lines li")
    assert "no, it crashed: it met the ground at 7.0 m/s" in page.text("#figures-row")
    assert page.complaints() == []


def test_a_vehicle_that_is_left_in_the_air_is_told_so(browser: Any, tmp_path: Path) -> None:
    left = {"outcome": "given_up", "reason": "", "landed": False, "left": "still in the air, in BRAKE, at 3.0 m"}
    page = Page(browser, make_story_report(tmp_path, lost_video(), left))
    page.wait(DRAWN)
    assert page.run(ANSWERS)[-1].split(" | ")[2] == "mission given up; not landed, still in the air, in BRAKE, at 3.0 m"
    assert "no: still in the air, in BRAKE, at 3.0 m" in page.text("#figures-row")
    assert page.complaints() == []


def test_what_an_autopilot_told_is_a_moment_of_the_run(browser: Any, tmp_path: Path) -> None:
    told = ("/told", LIFT_OFF_S + 12.0, {"words": "autopilot: Potential Thrust Loss (1)"})
    page = Page(browser, make_report(tmp_path, recordings=[told]))
    page.wait(DRAWN)
    assert "12.00 stoldautopilot: Potential Thrust Loss (1)" in page.text("#moments tbody tr").replace(" | ", "")
    assert page.complaints() == []


def test_what_follows_from_one_failure_is_one_row_with_what_the_autopilot_did(browser: Any, tmp_path: Path) -> None:
    page = Page(browser, make_story_report(tmp_path, lost_video(), {"outcome": "given_up", "reason": "", "landed": True, "collisions": 0}))
    page.wait(DRAWN)
    refused = "navigation.hover failed: refused"  # no fault of the robot does that: nothing is credited with it
    assert page.text("#reason") == f"ground station failed (killed, injected) at 40.00 s; {refused} at 43.06 s"
    rows = [row.split(" | ") for row in page.run(ANSWERS)]
    assert [row[:2] for row in rows] == [
        ["ground station failed (killed, injected)", "40.00 s"],
        [refused, "43.06 s"],
        ["the whole mission", ""],
    ]
    assert rows[0][2] == (
        "the mission fell back from “inspect” to “the video was lost”; interrupted goto; started hover; "
        "the mission fell back from “the video was lost” to “given up”; the autopilot changed to RTL: it flies home and lands by itself"
    )
    assert rows[0][3] == "noticed after 3.00 s"
    assert rows[2][2:] == ["mission given up; landed", "8 of 10 waypoints were not reached; nothing was hit", ""]
    assert "enough_frames was violated: frames per second: 6 below the limit for 1 s." in page.text("#lines")
    assert "navigation.land could not start, its precondition sdk_authority was not met: SDK_authority" in page.text("#lines")
    assert "57.00 sLanded." in page.text("#lines li")
    assert page.text(".chain li").startswith("failure40.00 sground station failed (killed, injected) | measurement43.00 s")
    assert page.complaints() == []


@pytest.mark.parametrize(
    ("asked", "what", "when", "sentence"),
    [
        ("radio@40", "radio failed (injected)", "40.00 s", "The radio was made to fail."),
        ("radio:out@40-41", "radio failed (out, injected)", "40.00 s until 41.00 s", "The radio works again."),
    ],
)
def test_a_failure_that_only_the_request_tells_of_is_told(
    browser: Any, tmp_path: Path, asked: str, what: str, when: str, sentence: str
) -> None:
    story = [entry for entry in lost_video() if entry[1] != "/fault"]
    make_story_report(tmp_path, story, {"outcome": "given_up", "reason": "", "landed": True, "injected": []})
    (tmp_path / "run.json").write_text(json.dumps({"scenario": "inspection", "faults": [asked, "lidar@900"], "world": ""}))
    write_report(tmp_path, title="inspection")
    page = Page(browser, f"file://{tmp_path / REPORT}")
    page.wait(DRAWN)
    assert page.text("#reason").startswith(f"{what} at 40.00 s; navigation.hover failed")
    assert sentence in page.text("#lines")
    assert "lidar" not in page.text("#account").replace("lidar@900", "")  # the flight was over before
    assert page.run(ANSWERS)[0].startswith(f"{what} | {when} | ")


def test_an_abort_is_no_failure_and_says_what_followed(browser: Any, tmp_path: Path) -> None:
    start = LIFT_OFF_S
    story: Story = [
        (start - 3, MISSION, {"outcome": "running", "reason": "", "waypoints": 5, "waypoints_reached": 0}),
        (start - 2, TREE, tree("INVALID", "INVALID")),
        (start, EVENTS, transition("navigation.flight_status", "ON_GROUND", "IN_AIR")),
        (start + 1, EVENTS, execution("navigation.goto", "RUNNING", 1)),
        (start + 19, EVENTS, execution("perception.lidar_depthmap", "FAILED", 1, message="too dark")),
        (start + 20, OPERATOR, {"command": "abort", "by": "mission", "reason": "aborted by the operator"}),
        (start + 20.1, EVENTS, execution("navigation.goto", "INTERRUPTED", 2)),
        (start + 20.2, EVENTS, execution("navigation.hover", "RUNNING", 3)),
        (start + 2, TREE, tree("RUNNING", "INVALID")),
        (start + 23, EVENTS, execution("navigation.land", "RUNNING", 4)),
        (start + 29, TREE, {**tree("RUNNING", "INVALID"), "status": "SUCCESS"}),
        (start + 30, MISSION, {"outcome": "aborted", "reason": "aborted by the operator", "waypoints": 5, "waypoints_reached": 1}),
    ]
    page = Page(browser, make_story_report(tmp_path, story, {"outcome": "aborted", "reason": "aborted by the operator", "landed": True}))
    page.wait(DRAWN)
    assert (page.text("#headline"), page.text("#reason")) == ("Mission aborted", "aborted by the operator")
    assert page.run(ANSWERS) == [
        "perception.lidar_depthmap failed: too dark | 19.00 s | nothing followed |  | ",
        "the whole mission |  | mission aborted; landed | 4 of 5 waypoints were not reached | ",
    ]
    assert "20.00 sThe mission is told to stop: aborted by the operator; started hover, land." in page.text("#lines li")
    assert page.text(".chain b") == "skill"
    assert page.text(".row:first-child .state") == "◦ stopped, as it was told to"
    assert page.status("navigate") == "INTERRUPTED"
    page.choose(10.0)
    assert page.text(".row:first-child .state") == "… runs"


def test_keys_go_from_event_to_event(browser: Any, tmp_path: Path) -> None:
    from selenium.webdriver.common.keys import Keys

    page = Page(browser, make_report(tmp_path))
    page.wait(DRAWN)
    page.choose(29.0)
    body = browser.find_element("tag name", "body")
    body.send_keys("n")
    assert page.run("alula.moment()") == pytest.approx(LIFT_OFF_S + 29.9)
    body.send_keys("n")
    assert page.run("alula.moment()") == pytest.approx(LIFT_OFF_S + 30.0)
    body.send_keys("p")
    assert page.run("alula.moment()") == pytest.approx(LIFT_OFF_S + 29.9)
    body.send_keys(Keys.HOME)
    assert page.run("alula.moment()") == pytest.approx(LIFT_OFF_S - 3.0)
    body.send_keys(Keys.END)
    page.wait("document.querySelector('#latest').getAttribute('aria-pressed') === 'true'")


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("size", SIZES)
def test_the_page_fits_the_screen_and_names_its_controls(browser: Any, tmp_path: Path, size: tuple[int, int], theme: str) -> None:
    page = Page(browser, make_report(tmp_path), size, theme)
    page.wait(DRAWN)
    assert page.run("document.documentElement.scrollWidth") <= size[0]
    assert page.run("document.documentElement.dataset.theme") == theme
    assert page.run(UNNAMED) == []
    assert page.complaints() == []


def test_markup_in_a_run_is_shown_and_never_run(browser: Any, tmp_path: Path) -> None:
    story = failing_story(name=HOSTILE)
    hostile = {"skillset": HOSTILE, "sequence": 9, "kind": "EXECUTION", "skill": HOSTILE, "id": HOSTILE}
    ended = {**hostile, "state": "FAILED", "result": HOSTILE, "message": HOSTILE, "inputs": {HOSTILE: HOSTILE}, "outputs": {}}
    page = Page(browser, make_report(tmp_path, [*story, (LIFT_OFF_S + 62, EVENTS, ended)]))
    page.wait(DRAWN)
    assert HOSTILE in page.text(".row .box")
    assert HOSTILE in page.text("#lines")
    assert page.run("document.querySelectorAll('main img, main script').length") == 0
    assert page.run("document.title") == "mapping"
    assert page.complaints() == []


def test_entries_that_make_no_sense_do_not_stop_the_page(browser: Any, tmp_path: Path) -> None:
    odd: Story = [
        (LIFT_OFF_S + 50, topic, {"kind": None, "stamp_s": 1}) for topic in (EVENTS, MISSION, "/decisions", "/data", "/unheard/of")
    ]
    page = Page(browser, make_report(tmp_path, [*failing_story(), *odd]))
    page.wait(DRAWN)
    page.choose(20.0)
    assert page.status("watch with the ZED") == "RUNNING"
    assert page.complaints() == []


def test_a_sample_moves_figures_and_map_and_leaves_the_timeline_of_a_long_run(browser: Any, tmp_path: Path) -> None:
    page = Page(browser, make_report(tmp_path))
    page.wait(DRAWN)
    page.run("window.drawn = document.querySelector('#timeline svg')")
    sample = "['/data', {}, {{skillset: 'navigation', data: 'guidance_state', value: {{position_enu_m: {{x: {}, y: 1, z: 9}}}}}}]"
    page.run(f"alula.take([{sample.format('alula.run.end + 0.05', 61)}])")
    page.wait("document.querySelector('#map-words').textContent.includes('east 61.0 m')")
    assert "height9 m" in page.text("#charts figcaption")
    assert page.run("document.querySelector('#timeline svg') === window.drawn")
    page.run(f"alula.take([{sample.format('alula.run.end + 5', 62)}])")  # wider than a pixel or two: all is drawn to scale again
    page.wait("document.querySelector('#map-words').textContent.includes('east 62.0 m')")
    assert page.run("document.querySelector('#timeline svg') !== window.drawn")
    assert page.complaints() == []


def test_a_tree_of_another_shape_replaces_the_first(browser: Any, tmp_path: Path) -> None:
    aborted: Story = [(LIFT_OFF_S + 61, TREE, tree("FAILURE", "INTERRUPTED", name="aborted mission"))]
    page = Page(browser, make_report(tmp_path, [*failing_story(), *aborted]))
    page.wait("alula.run.count > 0 && document.querySelector('.row') !== null")
    assert "aborted mission" in page.text(".row .box")
    page.choose(20.0)
    assert "navigate" in page.text(".row .box")


def test_how_an_execution_ended_is_what_its_event_says_and_not_what_its_name_sounds_like(browser: Any, tmp_path: Path) -> None:
    told = [("UNBLOCKED", "success", "rover"), ("DONE", "failure", "rover"), ("FAILSAFE_OFF", "result", "rover")]
    told += [("BLOCKED", "", "rover"), ("BLOCKED", "", "navigation"), ("ARRIVED", "", "navigation")]  # as older records do not say it
    story: Story = []
    for number, (name, kind, skillset) in enumerate(told):
        end = execution(f"{skillset}.goto", "TERMINATED", number, result=name)
        story.append((LIFT_OFF_S + number, EVENTS, {**end, "id": str(number), "result_kind": kind}))
    page = Page(browser, make_story_report(tmp_path, story, {"outcome": "accomplished"}))
    page.wait("alula.run.count > 0")
    assert page.run("alula.run.moments.map((one) => [one.text.split(' (')[0], one.bad])") == [
        ["rover.goto ended by itself", False],
        ["rover.goto failed or was refused", True],
        ["rover.goto ended, success unknown", False],
        ["rover.goto ended, success unknown", False],
        ["navigation.goto failed or was refused", True],
        ["navigation.goto ended by itself", False],
    ]


def test_a_failure_is_credited_to_the_fault_that_the_summary_traces_it_to(browser: Any, tmp_path: Path) -> None:
    at = LIFT_OFF_S
    story: Story = [
        (at, EVENTS, transition("navigation.flight_status", "ON_GROUND", "IN_AIR")),
        *[(at + since, "/fault", {"sensor": sensor, "mode": "dead"}) for since, sensor in ((10.0, "lidar"), (20.0, "zed"))],
        (at + 13.0, EVENTS, execution("mapping.lidar_mapping", "TERMINATED", 1, result="ABORTED", message="no scan registered for 3 s")),
        (at + 25.0, EVENTS, execution("navigation.goto", "TERMINATED", 2, result="BLOCKED", message="no nearer to the target")),
    ]
    lidar = {
        "sensor": "lidar",
        "mode": "dead",
        "t_s": 10.0,
        "detected_s": 10.3,
        "detected_by": "perception.lidar_status OK -> BROKEN",
        "failed": ["lidar_"],
    }
    zed = {"sensor": "zed", "mode": "dead", "t_s": 20.0, "detected_s": None, "detected_by": "", "failed": [], "answered_by": "not detected"}
    summary = {"outcome": "given_up", "answers": [{**lidar, "answered_by": "given up"}, zed], "lift_off": {"stamp_s": at}}
    page = Page(browser, make_story_report(tmp_path, story, summary))
    page.wait(DRAWN)
    rows = [row.split(" | ") for row in page.run(ANSWERS)]
    assert [row[0] for row in rows[:3]] == [
        "lidar failed (dead, injected)",
        "zed failed (dead, injected)",
        "navigation.goto failed: no nearer to the target",
    ]
    assert rows[0][3].startswith("noticed after 0.30 s")
    assert rows[1][2] == "nothing: it was not detected"
    chain = page.text(".chain li")
    assert chain.startswith("failure10.00 slidar failed (dead, injected) | resource10.30 sperception.lidar_status: OK → BROKEN, reported")
