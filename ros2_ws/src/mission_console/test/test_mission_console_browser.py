"""The page in a real browser (Debian's chromium, driven by Selenium), live and as a report; skipped where there is none."""

from __future__ import annotations

import asyncio
import contextlib
import json
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from mission_console_records import HOSTILE, LIFT_OFF_S, Story, execution, failing_story, transition, tree, write_record

from alula_common.network import free_port
from alula_common.record import EVENTS, MISSION, OPERATOR, TICKS, TREE
from mission_console.acts import ActError, Flight
from mission_console.admission import Admission
from mission_console.page import REPORT, write_report
from mission_console.server import Console

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
pytestmark = pytest.mark.skipif(CHROMIUM is None or DRIVER is None, reason="no browser: apt install chromium chromium-driver")

SIZES = [(1280, 800), (390, 844)]
WAIT_S = 60.0
SUMMARY = {
    "outcome": "degraded", "reason": "the ZED broke", "landed": True, "duration_s": 60.0, "distance_m": 60.0, "collisions": 0,
    "recovery": {"failure_s": 29.9, "detected_s": 30.0, "fallback_running_s": 30.5, "moving_again_s": 34.0},
    "lift_off": {"stamp_s": LIFT_OFF_S, "source": "simulator"}, "problems": [],
    "died": [{"name": "zed_depth", "when_s": 29.8, "how": "signal 11"}],
}  # fmt: skip


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for word in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage"):
        options.add_argument(word)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    driver.set_script_timeout(WAIT_S)
    yield driver
    driver.quit()


class Page:
    """A page that is open."""

    def __init__(self, browser: Any, address: str, size: tuple[int, int] = SIZES[0], theme: str = "light") -> None:
        self.browser = browser
        metrics = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": size[0] < 500}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": theme}]})
        browser.get("about:blank")  # ends the page before, which may still ask for its server
        browser.get_log("browser")
        browser.get(address)

    def run(self, script: str) -> Any:
        return self.browser.execute_script(f"return {script}")

    def wait(self, condition: str) -> None:
        from selenium.webdriver.support.ui import WebDriverWait

        WebDriverWait(self.browser, WAIT_S, 0.05).until(lambda _: self.run(condition), f"never: {condition}; {self.text('#headline')}")

    def text(self, selector: str) -> str:
        return str(self.run(f"[...document.querySelectorAll({json.dumps(selector)})].map((one) => one.textContent).join(' | ')"))

    def choose(self, since_lift_off_s: float) -> None:
        self.run(f"alula.choose({LIFT_OFF_S + since_lift_off_s})")
        self.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def status(self, node: str) -> str:
        return str(
            self.run(f"[...document.querySelectorAll('.row')].find((row) => row.textContent.includes({json.dumps(node)})).dataset.status")
        )

    def complaints(self) -> list[str]:
        return [str(entry["message"]) for entry in self.browser.get_log("browser")]


def make_report(folder: Path, story: Story | None = None, *, world: str = "yard.yaml") -> str:
    write_record(folder, failing_story() if story is None else story)
    (folder / "summary.json").write_text(json.dumps(SUMMARY), encoding="utf-8")
    (folder / "run.json").write_text(json.dumps({"scenario": "mapping", "seed": 1, "faults": ["zed@30"], "world": world}), encoding="utf-8")
    fault = ("/fault", LIFT_OFF_S + 29.9, {"sensor": "zed", "mode": "dead"})
    health = ("/health", LIFT_OFF_S + 30.0, {"sensor": "zed", "ok": False, "fault": "silent", "reason": "no image for 0.4 s"})
    write_report(folder, [fault, health], title="mapping")
    return f"file://{folder / REPORT}"


UNNAMED = (
    "[...document.querySelectorAll('button, input, select, progress, canvas, img, [role=img]')].filter((one) => !one.closest('[hidden]') &&"
    "!(one.textContent.trim() || one.getAttribute('aria-label') || one.alt || one.closest('label'))).map((one) => one.outerHTML)"
)
"""Controls and pictures that a screen reader has no name for."""
ANSWERS = (
    "[...document.querySelectorAll('#answers tbody tr')].map((row) => [...row.children].map((cell) =>"
    "(cell.tagName === 'TH' ? cell.firstChild : cell).textContent).join(' | '))"
)
"""The rows of what failed, when, what was done, what it cost."""


def test_the_report_says_what_failed_when_what_was_done_and_what_it_cost(browser: Any, tmp_path: Path) -> None:
    page = Page(browser, make_report(tmp_path))
    page.wait("alula.run.count > 0 && document.querySelector('#timeline svg') !== null")
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
    assert rows[0][3] == "noticed after 0.10 s; the fallback ran after 0.60 s; the vehicle moved on after 4.10 s"
    assert rows[1][2:] == ["mission accomplished in degraded mode; landed", "no waypoint was missed; nothing was hit"]
    assert page.complaints() == []


def test_the_slider_moves_tree_timeline_map_and_figures_together(browser: Any, tmp_path: Path) -> None:
    page = Page(browser, make_report(tmp_path))
    page.wait("alula.run.count > 0 && document.querySelector('#timeline svg') !== null")
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
    page.wait("alula.run.count > 0 && document.querySelector('#timeline svg') !== null")
    words = {}
    for t_s in (10.0, 15.0, 30.0, 50.0):
        page.choose(t_s)
        words[t_s] = page.text("#map-words")
    assert f"In the radio zone “{HOSTILE}”: critical." in words[10.0]  # the first that is listed counts
    assert "In the radio zone “mast”: degraded." in words[15.0]
    assert "radio zone" not in words[30.0]
    assert "In the radio zone “jammer”: degraded." in words[50.0]
    assert "Fence: 60 m around home, 10.0 m away." in words[50.0]
    page.run("document.querySelector('#map-3d').click()")
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
    assert "17 1/s, 0.93 SSIM, 1200 kbit/s, 0.21 s delay, 1.5 % lost" in page.text("#pictures .hint")
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
    page.wait("alula.run.count > 0 && document.querySelector('#timeline svg') !== null")
    chain = page.text(".chain b").split(" | ")
    assert chain[-3:] == ["branch", "decision", "started"]
    assert page.text("#lines li").count("The mission is paused") == 1
    rows = [row.split(" | ") for row in page.run(ANSWERS)]
    paused = ["no failure: the operator had the mission pause", "20.00 s until 89.90 s", "navigation.goto holds", "69.9 s paused"]
    assert rows[0] == paused
    assert rows[1][0] == "zed failed (dead, injected)"
    assert "90.00 sReaction: the mission fell back from “ZED navigation” to “LiDAR navigation”" in page.text("#lines li")
    assert "paused 20.00 s" in page.text("#timeline text")
    assert "goes on 89.90 s" in page.text("#timeline text")
    assert page.complaints() == []


def lost_video() -> Story:
    """Return the entries of an inspection whose ground station is killed; the autopilot's failsafe overtakes the reaction."""
    start, why = LIFT_OFF_S, "sdk_authority: SDK_authority is UNAVAILABLE"
    inspect, lost = ({"kind": "sequence", "skill": "", "message": "", "children": []} for _ in range(2))

    def shape(first: str, second: str, third: str) -> dict[str, Any]:
        stream = {**inspect, "name": "send the video", "kind": "skill", "skill": "video.stream", "status": first}
        land = {**lost, "name": "land", "kind": "skill", "skill": "navigation.land", "status": second}
        branches = [
            {**inspect, "name": "inspect", "status": first, "children": [stream]},
            {**lost, "name": "the video was lost", "status": second, "children": [land]},
            {**lost, "name": "given up", "status": third},
        ]
        return {**inspect, "name": "inspection", "kind": "selector", "status": "RUNNING", "children": branches}

    def guided(t_s: float, mode: str) -> tuple[float, str, dict[str, Any]]:
        return (start + t_s, "/data", {"skillset": "navigation", "data": "guidance_state", "value": {"mode": mode}, "stamp_s": 0.0})

    picture = {"skillset": "video", "data": "picture", "value": {"fps_margin": -6}, "stamp_s": 1.0}
    low = execution("video.stream", "RESOURCE_INVARIANT_VIOLATED", 2, result="enough_frames", message="picture.fps_margin is -6 for 1 s")
    return [
        (start - 3, MISSION, {"scenario": "inspection", "outcome": "running", "reason": "", "waypoints": 10, "waypoints_reached": 0}),
        (start, EVENTS, transition("navigation.flight_status", "ON_GROUND", "IN_AIR")),
        (start + 1, EVENTS, execution("video.stream", "RUNNING", 1)),
        (start + 2, EVENTS, execution("navigation.goto", "RUNNING", 1)),
        (start + 1, TREE, shape("RUNNING", "INVALID", "INVALID")),
        guided(2.0, "GUIDED"),
        (start + 40, "/fault", {"sensor": "ground_station", "mode": "killed"}),
        (start + 43, "/data", picture),
        (start + 43, EVENTS, low),
        (start + 43, TREE, shape("FAILURE", "RUNNING", "INVALID")),
        (start + 43.02, EVENTS, execution("navigation.goto", "INTERRUPTED", 2)),
        (start + 43.04, EVENTS, execution("navigation.hover", "RUNNING", 3)),
        (start + 43.06, EVENTS, execution("navigation.hover", "FAILED", 4, message="refused")),  # the reaction before is not its own
        guided(45.0, "RTL"),
        (start + 45, EVENTS, transition("navigation.SDK_authority", "AVAILABLE", "UNAVAILABLE")),
        (start + 45, EVENTS, execution("navigation.land", "NOT_READY", 3, result="sdk_authority", message=why)),
        (start + 45, TREE, shape("FAILURE", "FAILURE", "RUNNING")),
        (start + 57, EVENTS, transition("navigation.flight_status", "IN_AIR", "ON_GROUND")),
        (start + 58, MISSION, {"outcome": "given_up", "reason": why, "waypoints": 10, "waypoints_reached": 2, "end_s": start + 58}),
    ]


def make_story_report(folder: Path, story: Story, summary: dict[str, Any]) -> str:
    """Write the report of a story: the record, and what other recordings tell."""
    told = [entry for entry in story if entry[1] == "/fault"]
    write_record(folder, [entry for entry in story if entry[1] != "/fault"])
    (folder / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    (folder / "run.json").write_text(json.dumps({"scenario": "inspection", "seed": 1, "world": ""}), encoding="utf-8")
    write_report(folder, [(topic, t_s, value) for t_s, topic, value in told], title="inspection")
    return f"file://{folder / REPORT}"


def test_what_follows_from_one_failure_is_one_row_with_what_the_autopilot_did(browser: Any, tmp_path: Path) -> None:
    page = Page(browser, make_story_report(tmp_path, lost_video(), {"outcome": "given_up", "reason": "", "landed": True, "collisions": 0}))
    page.wait("alula.run.count > 0 && document.querySelector('#timeline svg') !== null")
    assert page.text("#reason") == "ground station failed (killed, injected) at 40.00 s"
    rows = [row.split(" | ") for row in page.run(ANSWERS)]
    assert [row[:2] for row in rows] == [["ground station failed (killed, injected)", "40.00 s"], ["the whole mission", ""]]
    assert rows[0][2] == (
        "the mission fell back from “inspect” to “the video was lost”; interrupted goto; started hover; "
        "the mission fell back from “the video was lost” to “given up”; the autopilot changed to RTL: it flies home and lands by itself"
    )
    assert rows[0][3] == "noticed after 3.00 s"
    assert rows[1][2:] == ["mission given up; landed", "8 of 10 waypoints were not reached; nothing was hit"]
    assert "enough_frames was violated: picture.fps_margin is -6 (fps is 6 1/s below its limit) for 1 s." in page.text("#lines")
    assert "navigation.land could not start, its precondition sdk_authority was not met: SDK_authority" in page.text("#lines")
    assert "57.00 sLanded." in page.text("#lines li")
    assert page.text(".chain li").startswith("before40.00 sground station failed (killed, injected) | measurement43.00 s")
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
    page.wait("alula.run.count > 0 && document.querySelector('#timeline svg') !== null")
    assert page.text("#reason") == f"{what} at 40.00 s"
    assert sentence in page.text("#lines")
    assert "lidar" not in page.text("#story").replace("lidar@900", "")  # the flight was over before
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
        (start + 23, EVENTS, execution("navigation.land", "RUNNING", 4)),
        (start + 30, MISSION, {"outcome": "aborted", "reason": "aborted by the operator", "waypoints": 5, "waypoints_reached": 1}),
    ]
    page = Page(browser, make_story_report(tmp_path, story, {"outcome": "aborted", "reason": "aborted by the operator", "landed": True}))
    page.wait("alula.run.count > 0 && document.querySelector('#timeline svg') !== null")
    assert (page.text("#headline"), page.text("#reason")) == ("Mission aborted", "aborted by the operator")
    assert page.run(ANSWERS) == [
        "perception.lidar_depthmap: failed | 19.00 s | nothing followed | ",
        "no failure: aborted by the operator | 20.00 s | started: hover, land | the rest of the mission",
        "the whole mission |  | mission aborted; landed | 4 of 5 waypoints were not reached",
    ]
    assert page.text(".chain b") == "skill"


def test_keys_go_from_event_to_event(browser: Any, tmp_path: Path) -> None:
    from selenium.webdriver.common.keys import Keys

    page = Page(browser, make_report(tmp_path))
    page.wait("alula.run.count > 0 && document.querySelector('#timeline svg') !== null")
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
    page.wait("alula.run.count > 0 && document.querySelector('#timeline svg') !== null")
    assert page.run("document.documentElement.scrollWidth") <= size[0]
    assert page.run("document.documentElement.dataset.theme") == theme
    assert page.run(UNNAMED) == []
    assert page.complaints() == []


def test_markup_in_a_run_is_shown_and_never_run(browser: Any, tmp_path: Path) -> None:
    story = failing_story(name=HOSTILE)
    hostile = {"skillset": HOSTILE, "sequence": 9, "kind": "EXECUTION", "skill": HOSTILE, "id": HOSTILE}
    ended = {**hostile, "state": "FAILED", "result": HOSTILE, "message": HOSTILE, "inputs": {HOSTILE: HOSTILE}, "outputs": {}}
    page = Page(browser, make_report(tmp_path, [*story, (LIFT_OFF_S + 62, EVENTS, ended)]))
    page.wait("alula.run.count > 0 && document.querySelector('#timeline svg') !== null")
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
    page.wait("alula.run.count > 0 && document.querySelector('#timeline svg') !== null")
    page.choose(20.0)
    assert page.status("watch with the ZED") == "RUNNING"
    assert page.complaints() == []


# --- live ------------------------------------------------------------------------------------------------------------------


class Served:
    """A console in a thread of its own, which can be stopped and started."""

    def __init__(self, fixed: Path) -> None:
        self._fixed, self.port = fixed, free_port()
        self._stop: Callable[[], None] = lambda: None

    def start(self) -> None:
        up = threading.Event()

        async def main() -> None:
            over = asyncio.Event()
            loop = asyncio.get_running_loop()
            self._stop = lambda: loop.call_soon_threadsafe(over.set)
            async with Console(Admission("127.0.0.1", self.port, ""), fixed=self._fixed).open():
                up.set()
                await over.wait()

        self._thread = threading.Thread(target=lambda: asyncio.run(main()), daemon=True)
        self._thread.start()
        assert up.wait(WAIT_S)

    def stop(self) -> None:
        self._stop()
        self._thread.join(WAIT_S)


@contextlib.contextmanager
def served(fixed: Path) -> Iterator[Served]:
    console = Served(fixed)
    console.start()
    try:
        yield console
    finally:
        console.stop()


def test_the_live_page_follows_says_when_it_is_cut_off_and_is_true_again(
    browser: Any, make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    story = failing_story()
    monkeypatch.setattr("mission_console.commands.is_live", lambda run: not (run / "summary.json").exists())
    early = [entry for entry in story if entry[0] < LIFT_OFF_S + 20]
    folder = make_run("live", story=[])
    writer = write_record(folder, early, over=False)
    with served(folder) as console:
        page = Page(browser, f"http://127.0.0.1:{console.port}/")
        page.wait("document.querySelector('.row') !== null && alula.run.end > 31")
        assert page.status("watch with the ZED") == "RUNNING"
        assert page.text("#headline") == "The mission is under way"
        assert page.complaints() == []
        for t_s, topic, value in story:
            if t_s >= LIFT_OFF_S + 20 and topic in {EVENTS, TREE}:
                writer.write(topic, round(t_s * 1e9), value)
        page.wait("document.querySelector('.chain') !== null")
        assert page.status("watch with the ZED") == "FAILURE"
        console.stop()
        page.wait("document.querySelector('#link').dataset.state === 'stale'")
        assert "disconnected" in page.text("#link")
        assert page.run("document.querySelector('#flight .danger:not(:disabled)') === null")
        writer.write(MISSION, round((LIFT_OFF_S + 61) * 1e9), story[-1][2])
        console.start()
        page.wait("document.querySelector('#link').dataset.state !== 'stale'")
        page.wait("document.querySelector('#headline').textContent === 'Mission accomplished in degraded mode'")
        assert "30.00 sThe zed was made to fail." in page.text("#lines li")  # as asked for
        assert page.run("document.querySelector('#operator form select').value") != "mapping"
        page.run("document.querySelector('#operator form select').value = 'mapping'")
        lift_off = {"stamp_s": LIFT_OFF_S - 0.5, "source": "simulator"}
        injected = [{"sensor": "zed", "mode": "dead", "t_s": 30.4}]
        (folder / "summary.json").write_text(json.dumps({**SUMMARY, "injected": injected, "lift_off": lift_off}))
        page.wait("document.querySelector('#lines').textContent.includes('The zed was made to fail (dead).')")
        chain = page.text(".chain li")
        assert chain.startswith("failure30.40 szed failed (dead, injected) | resource30.50 s")  # all times count from the same lift-off
        assert page.run("document.querySelector('#operator form select').value") == "mapping", "another lift-off leaves the form alone"
    writer.close()
    assert [line for line in page.complaints() if "WebSocket connection" not in line and "ERR_" not in line] == []


def test_a_run_that_ends_without_a_verdict_is_not_said_to_be_under_way(
    browser: Any, make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, live = make_run("live", story=[]), [True]
    monkeypatch.setattr("mission_console.commands.is_live", lambda _run: live[0])
    writer = write_record(folder, [entry for entry in failing_story() if entry[0] < LIFT_OFF_S + 20], over=False)
    with served(folder) as console:
        page = Page(browser, f"http://127.0.0.1:{console.port}/")
        page.wait("document.querySelector('#headline').textContent === 'The mission is under way' && alula.live.state === 'live'")
        live[0] = False
        page.wait("document.querySelector('#headline').textContent === 'The mission\\'s process ended before the mission did'")
        page.wait("document.querySelector('#link').dataset.state === 'over'")
        assert page.run("document.querySelector('#flight .danger:not(:disabled)') === null")
        assert page.complaints() == []
    writer.close()


def test_a_flight_is_started_by_the_form_and_a_refusal_is_shown(
    browser: Any, make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    from selenium.webdriver.support.ui import Select

    first, asked = make_run("first"), []

    def start(flight: Flight) -> Path:
        asked.append(flight)
        if flight.world:
            raise ActError(f"there is no world {flight.world}")
        return make_run("second", story=[])

    monkeypatch.setattr("mission_console.acts.start", start)
    with served(first) as console:
        page = Page(browser, f"http://127.0.0.1:{console.port}/")
        page.wait("document.querySelectorAll('#operator form select option').length > 3 && alula.live.state === 'over'")
        browser.find_element("css selector", "#operator summary").click()
        scenario, vehicle = browser.find_elements("css selector", "#operator form select")
        Select(scenario).select_by_visible_text("mapping")
        Select(vehicle).select_by_visible_text("mocks")
        world = browser.find_element("css selector", "#operator form input[list]")
        world.send_keys(HOSTILE)
        seed = browser.find_element("css selector", "#operator form input[type=number]")
        seed.clear()
        seed.send_keys("7")
        browser.find_element("css selector", "#operator form input[aria-label^=failures]").send_keys("zed@30, lidar@60")
        button = browser.find_element("css selector", "#operator form .go")
        button.click()
        assert asked == []
        button.click()
        page.wait("document.querySelector('#flight output').textContent.includes('refused: there is no world')")
        assert page.run("document.querySelector('#operator details').open") is True
        world.clear()
        button.click()
        button.click()
        page.wait("alula.live.link.status.run === 'second'")
        assert page.run("document.querySelector('#operator details').open") is False
        assert page.complaints() == []
    assert asked[1] == Flight("mapping", 7, ("zed@30", "lidar@60"), "", "mocks", "")


def test_an_act_needs_two_presses_and_everything_off_a_word(
    browser: Any, make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, done = make_run("live"), []
    monkeypatch.setattr("mission_console.commands.is_live", lambda _run: True)
    for act in ("abort", "everything_off"):
        monkeypatch.setattr(f"mission_console.acts.{act}", lambda run, act=act: done.append((act, run.name)) or f"{act} is done")
    with served(folder) as console:
        page = Page(browser, f"http://127.0.0.1:{console.port}/")
        abort, off = (f"[...document.querySelectorAll('#flight .danger')][{index}]" for index in (1, 2))
        page.wait(f"{abort} !== undefined && !{abort}.disabled")
        page.run(f"{abort}.click()")
        assert page.run(f"{abort}.textContent") == "press again: stop and land"
        assert done == []
        page.run(f"{abort}.click()")
        page.wait("document.querySelector('#flight output').textContent.includes('abort is done')")
        assert page.run(f"{off}.disabled") is True
        page.browser.find_element("css selector", "#flight input[placeholder='type OFF']").send_keys("off")
        page.run(f"{off}.click(), {off}.click()")
        page.wait("document.querySelector('#flight output').textContent.includes('everything_off is done')")
        page.wait("document.querySelector('#lines').textContent.includes('The operator switched everything off')")
        assert page.complaints() == []
    assert done == [("abort", "live"), ("everything_off", "live")]


@pytest.mark.parametrize("size", SIZES)
def test_the_acts_on_a_flight_stay_in_sight_and_an_answer_moves_nothing(
    browser: Any, make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch, size: tuple[int, int]
) -> None:
    folder = make_run("live")
    monkeypatch.setattr("mission_console.commands.is_live", lambda _run: True)
    monkeypatch.setattr("mission_console.acts.pause", lambda _run: "held: " + "a skill that goes on, " * 40)
    pause = "[...document.querySelectorAll('#flight button')][0]"
    with served(folder) as console:
        page = Page(browser, f"http://127.0.0.1:{console.port}/", size)
        page.wait(f"{pause} !== undefined && !{pause}.disabled && document.querySelector('.row') !== null")
        page.run("scrollTo(0, document.documentElement.scrollHeight / 2)")
        page.wait("document.querySelector('#flight').getBoundingClientRect().top === 0")
        buttons = "[...document.querySelectorAll('#flight button:not([hidden])')]"
        assert page.run(f"{buttons}.every((one) => one.getBoundingClientRect().top < 120)")
        page.run("scrollTo(0, 0)")
        before = page.run("document.querySelector('main').getBoundingClientRect().top")
        page.run(f"{pause}.click(), {pause}.click()")
        page.wait("document.querySelector('#flight output').textContent.includes('a skill that goes on')")
        assert page.run("document.querySelector('main').getBoundingClientRect().top") == before
        assert page.complaints() == []


def test_what_the_mission_needs_to_start_is_shown_and_turns_green(browser: Any, make_run: Callable[..., Path]) -> None:
    folder = make_run("live", story=[])
    ready, fence = ["the home point is valid", "the home point is not valid"], [f"a fence {HOSTILE}", ""]
    writer = write_record(folder, [(1.0, TICKS, {"unmet": [ready[1]], "conditions": [ready, fence]})], over=False)
    with served(folder) as console:
        page = Page(browser, f"http://127.0.0.1:{console.port}/")
        page.wait("document.querySelectorAll('#operator .checks li').length === 2")
        assert page.text("#operator .checks li") == f"not met: the home point is not valid | met: a fence {HOSTILE}"
        assert page.run("document.querySelectorAll('#operator .checks li.met').length") == 1
        assert "before the start: 1 of 2 conditions met" in page.text("#operator summary")
        writer.write(TICKS, 2_000_000_000, {"unmet": [], "conditions": [[ready[0], ""], fence]})
        writer.write(TICKS, 3_000_000_000, {"unmet": []})
        page.wait("document.querySelectorAll('#operator .checks li.met').length === 2")
        assert page.text("#operator .checks li").startswith("met: the home point is valid")
        assert page.complaints() == []
    writer.close()


def test_a_pause_is_shown_until_the_mission_goes_on(browser: Any, make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []
    folder = make_run("live", story=[])
    writer = write_record(folder, [entry for entry in failing_story() if entry[0] < LIFT_OFF_S + 20], over=False)
    monkeypatch.setattr("mission_console.commands.is_live", lambda _run: True)
    for act in ("pause", "resume"):
        monkeypatch.setattr(f"mission_console.acts.{act}", lambda run, act=act: done.append(f"{act} {run.name}") or act)
    button = "[...document.querySelectorAll('#flight button')].find((one) => one.textContent === '{}' && !one.hidden && !one.disabled)"
    with served(folder) as console:
        page = Page(browser, f"http://127.0.0.1:{console.port}/")
        page.wait(f"{button.format('pause')} !== undefined")
        assert page.run(f"{button.format('go on')} === undefined")
        page.run(f"{button.format('pause')}.click()")
        assert done == []
        page.run(f"{button.format('press again: pause')}.click()")
        page.wait("document.querySelector('#flight output').textContent === 'pause: pause'")
        writer.write(OPERATOR, round(33e9), {"command": "paused", "by": "mission", "reason": "navigation.goto holds"})
        page.wait("document.querySelector('.held').textContent === 'The mission is paused. navigation.goto holds'")
        page.wait("document.querySelector('#headline').textContent === 'The mission is paused'")
        page.run(f"{button.format('go on')}.click(), {button.format('press again: go on')}.click()")
        writer.write(OPERATOR, round(40e9), {"command": "resume", "by": "mission", "reason": ""})
        page.wait("document.querySelector('.held').textContent === ''")
        page.wait("document.querySelector('#lines').textContent.includes('The mission goes on.')")
        assert page.complaints() == []
    writer.close()
    assert done == ["pause live", "resume live"]


def test_a_sample_moves_figures_and_map_and_leaves_the_timeline_of_a_long_run(browser: Any, tmp_path: Path) -> None:
    page = Page(browser, make_report(tmp_path))
    page.wait("alula.run.count > 0 && document.querySelector('#timeline svg') !== null")
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


BY_HAND = {
    "problems": [],
    "skillsets": [
        {
            "root": "/navigation",
            "alive": True,
            "skills": [
                {
                    "name": "takeoff", "status": "not ready", "unmet": [f"on_ground: flight_status is {HOSTILE}"], "running": [],
                    "last": {"state": "TERMINATED", "result": "AT_ALTITUDE", "message": HOSTILE, "t_s": 15.0, "inputs": {}, "outputs": {}},
                    "inputs": [{"name": "height", "kind": "float64", "said": "< h_geo_fence", "text": "0.0"}],
                },
                {
                    "name": "hover", "status": "RUNNING", "unmet": [], "last": None,
                    "running": [{"id": "abcdef012", "state": "RUNNING", "progress": 0.5}],
                    "inputs": [{"name": "duration", "kind": "float64", "said": "> 0", "text": "0.0"}],
                },
            ],
            "resources": [{"name": "flight_status", "state": "IN_AIR", "targets": ["ON_GROUND"], "every_target": ["IN_AIR", "ON_GROUND"]}],
            "data": [{"name": "guidance_state", "value": HOSTILE, "age_s": 0.2, "stale": False}],
        }
    ],
}  # fmt: skip


class Listened:
    """Stands for the skillsets of a run."""

    def __init__(self, _domain: int) -> None:
        self.asked: list[dict[str, Any]] = []
        LISTENED.append(self)

    def describe(self) -> dict[str, Any]:
        return BY_HAND

    def do(self, asked: dict[str, Any]) -> tuple[str, str]:
        self.asked.append({name: asked[name] for name in asked if name not in {"command", "run"}})
        return f"{asked['act']} it", f"done {HOSTILE}"

    def close(self) -> None:
        self.asked.append({"act": "close"})


LISTENED: list[Listened] = []


@pytest.mark.parametrize("size", SIZES)
def test_skills_are_driven_by_hand(
    browser: Any, make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch, size: tuple[int, int]
) -> None:
    folder = make_run("live")
    monkeypatch.setattr("mission_console.commands.is_live", lambda _run: True)
    monkeypatch.setattr("mission_console.commands.Hands", Listened)
    LISTENED.clear()
    with served(folder) as console:
        page = Page(browser, f"http://127.0.0.1:{console.port}/", size)
        page.wait("document.querySelector('#hands') !== null && !document.querySelector('#hands').hidden && alula.live.state === 'live'")
        assert LISTENED == []
        page.browser.find_element("css selector", "#hands summary").send_keys(" ")  # a key of its own, not the one that plays
        assert page.run("document.querySelector('#play').getAttribute('aria-pressed')") != "true"
        page.wait("document.querySelectorAll('.skills li').length === 2")
        assert "could not start now:" in page.text(".needs")
        assert HOSTILE in page.text(".needs")
        assert page.text(".skill label b + .hint") == " float64, < h_geo_fence"
        height = page.browser.find_element("css selector", ".skill input")
        height.clear()
        height.send_keys("4.5")
        start = "document.querySelector('#hands form .go')"
        page.run(f"{start}.click()")
        assert page.run(f"{start}.textContent") == "press again: start takeoff"
        assert LISTENED[0].asked == []
        page.run(f"{start}.click()")
        page.wait("document.querySelector('#hands output').textContent.includes('done')")
        page.run("[...document.querySelectorAll('.pick')][1].click()")
        assert page.run("document.querySelector('.skills progress:not([style*=hidden])').value") == 0.5
        interrupt = "document.querySelector('.skill .danger')"
        page.run(f"{interrupt}.click(), {interrupt}.click()")
        assert page.text(".resources button:not([hidden])") == "→ ON_GROUND"
        change = "document.querySelector('.resources button:not([hidden])')"
        page.run(f"{change}.click(), {change}.click()")
        page.wait("document.querySelector('#lines').textContent.includes('transition it')")
        assert LISTENED[0].asked == [
            {"act": "start", "root": "/navigation", "skill": "takeoff", "texts": {"height": "4.5"}},
            {"act": "interrupt", "root": "/navigation", "skill": "hover"},
            {"act": "transition", "root": "/navigation", "resource": "flight_status", "to": "ON_GROUND"},
        ]
        assert page.run("document.documentElement.scrollWidth") <= size[0]
        assert page.run(UNNAMED) == []
        assert page.run("document.title") == "Alula"
        page.run("document.querySelector('#hands summary').click()")
        page.wait("document.querySelector('#hands').open === false")
        end = time.monotonic() + WAIT_S
        while LISTENED[0].asked[-1] != {"act": "close"}:
            assert time.monotonic() < end
            page.run("new Promise((done) => setTimeout(done, 50))")
        assert page.complaints() == []


def test_a_tree_of_another_shape_replaces_the_first(browser: Any, tmp_path: Path) -> None:
    aborted: Story = [(LIFT_OFF_S + 61, TREE, tree("FAILURE", "INTERRUPTED", name="aborted mission"))]
    page = Page(browser, make_report(tmp_path, [*failing_story(), *aborted]))
    page.wait("alula.run.count > 0 && document.querySelector('.row') !== null")
    assert "aborted mission" in page.text(".row .box")
    page.choose(20.0)
    assert "navigate" in page.text(".row .box")
