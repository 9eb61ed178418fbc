"""The live page in a browser: what it shows of a run that goes on, and what the operator does on it."""

from __future__ import annotations

import json
import re
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from console_page import DRAWN, SIZES, UNNAMED, Page
from console_records import HOSTILE, LIFT_OFF_S, failing_story, transition, write_record
from console_reports import SUMMARY
from console_serving import OPTIONS, WAIT_S, Robot, served

from alula.common.record import EVENTS, MISSION, OPERATOR, TICKS, TREE
from alula.common.run_log import note_act
from alula.console.acts import ActError, WantedRun
from alula.report.page.entries import FAULT, HEALTH, PATH
from alula.report.page.writing import write_report


def test_the_live_page_follows_says_when_it_is_cut_off_and_is_true_again(
    browser: Any, make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    story = failing_story()
    monkeypatch.setattr("alula.console.commands.is_live", lambda run: not (run / "summary.json").exists())
    early = [entry for entry in story if entry[0] < LIFT_OFF_S + 20]
    folder = make_run("live", story=[])
    writer = write_record(folder, early, over=False)
    with served(folder) as console:
        page = Page(browser, console.address)
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
        assert page.run("document.querySelector('#acts .danger:not(:disabled)') === null")
        writer.write(MISSION, round((LIFT_OFF_S + 61) * 1e9), story[-1][2])
        console.start()
        page.wait("document.querySelector('#link').dataset.state !== 'stale'")
        page.wait("document.querySelector('#headline').textContent === 'Mission accomplished in degraded mode'")
        assert "30.00 sThe zed was made to fail." in page.text("#lines li")  # as asked for
        assert page.run("document.querySelector('#operator form select').value") != "mapping"
        page.run("document.querySelector('#operator form select').value = 'mapping'")
        lift_off = {"stamp_s": LIFT_OFF_S - 0.5, "source": "simulator"}
        answer = {"sensor": "zed", "mode": "dead", "t_s": 30.4, "detected_s": 30.5, "failed": ["zed_de"]}
        (folder / "summary.json").write_text(json.dumps({**SUMMARY, "answers": [answer], "lift_off": lift_off}))
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
    monkeypatch.setattr("alula.console.commands.is_live", lambda _run: live[0])
    writer = write_record(folder, [entry for entry in failing_story() if entry[0] < LIFT_OFF_S + 20], over=False)
    with served(folder) as console:
        page = Page(browser, console.address)
        page.wait("document.querySelector('#headline').textContent === 'The mission is under way' && alula.live.state === 'live'")
        live[0] = False
        page.wait("document.querySelector('#headline').textContent === 'The mission\\'s process ended before the mission did'")
        page.wait("document.querySelector('#link').dataset.state === 'over'")
        assert page.run("document.querySelector('#acts .danger:not(:disabled)') === null")
        assert page.complaints() == []
    writer.close()


def test_a_run_is_started_by_the_form_and_a_refusal_is_shown(
    browser: Any, make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    from selenium.webdriver.common.keys import Keys
    from selenium.webdriver.support.ui import Select

    first, asked = make_run("first"), []

    def start(wanted: WantedRun) -> Path:
        asked.append(wanted)
        if wanted.seed == 8:
            raise ActError("all DDS domains are taken")
        return make_run("second", story=[])

    monkeypatch.setattr("alula.console.acts.start", start)
    with served(first, options=OPTIONS) as console:
        page = Page(browser, console.address)
        page.wait("document.querySelectorAll('#operator form select option').length > 3 && alula.live.state === 'over'")
        page.unfold("#operator details:has(form)")
        scenario, over, record = browser.find_elements("css selector", "#operator form select")
        Select(scenario).select_by_visible_text("mapping")
        browser.find_element("css selector", "#operator form .own input").send_keys("tcp:base:5")
        assert [option.text for option in Select(record).options] == ["functional", "sensors"]
        Select(over).select_by_visible_text("mocks")
        assert page.run("document.querySelector('#operator .own').checkVisibility()") is False
        world = browser.find_element("css selector", "#operator form input[list]")
        world.send_keys(HOSTILE)
        seed = browser.find_element("css selector", "#operator form input[type=number]")
        seed.clear()
        seed.send_keys("7")
        browser.find_element("css selector", "#operator form input[aria-label^=failures]").send_keys("zed@30, lidar@60")
        button = browser.find_element("css selector", "#operator form .go")
        button.send_keys(Keys.ENTER)
        assert asked == []
        button.send_keys(Keys.ENTER)
        page.wait("document.querySelector('#acts output').textContent.startsWith('start: refused: <img src=x')")
        assert page.run("document.querySelector('#operator details').open") is True
        world.clear()
        seed.send_keys("8")
        seed.send_keys(Keys.HOME, Keys.DELETE)
        button.send_keys(Keys.ENTER)
        button.send_keys(Keys.ENTER)
        page.wait("document.querySelector('#acts output').textContent === 'start: refused: all DDS domains are taken'")
        seed.send_keys(Keys.HOME, Keys.DELETE, "7")
        button.send_keys(Keys.ENTER)
        button.send_keys(Keys.ENTER)
        page.wait("alula.live.link.status.run === 'second'")
        assert page.run("document.querySelector('#operator details').open") is False
        assert page.complaints() == []
        page.unfold("#operator details:has(form)")
        Select(over).select_by_visible_text("live")
        Select(record).select_by_visible_text("sensors")
        button.send_keys(Keys.ENTER)
        button.send_keys(Keys.ENTER)
        page.wait("document.querySelector('#acts output').textContent === 'start: second is started'")
    again = WantedRun("mapping", 7, ("zed@30", "lidar@60"), options=("--link=tcp:base:5", "--record=sensors"))
    assert asked[1:] == [WantedRun("mapping", 7, ("zed@30", "lidar@60"), mock=True), again]


def test_an_act_needs_two_presses_and_everything_off_a_word(
    browser: Any, make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, done = make_run("live"), []
    monkeypatch.setattr("alula.console.commands.is_live", lambda _run: True)
    monkeypatch.setattr("alula.console.acts.everything_off", lambda run: done.append(run.name) or "everything_off is done")
    with served(folder, Robot(abort=lambda: done.append("abort") or "abort is done")) as console:
        page = Page(browser, console.address)
        abort, off = (f"document.querySelector('#acts {kind}')" for kind in (".stop", ".danger"))
        page.wait(f"{abort} !== null && !{abort}.disabled && {abort}.textContent === 'stop and land'")
        page.run(f"{abort}.click()")
        assert page.run(f"{abort}.textContent") == "press again: stop and land"
        assert done == []
        page.run(f"{abort}.click()")
        page.wait("document.querySelector('#acts output').textContent.includes('abort is done')")
        assert page.run(f"{off}.disabled") is True
        page.browser.find_element("css selector", "#acts input[placeholder='type OFF']").send_keys("off")
        page.run(f"{off}.click(), {off}.click()")
        page.wait("document.querySelector('#acts output').textContent.includes('everything_off is done')")
        page.wait("document.querySelector('#lines').textContent.includes('The operator switched everything off')")
        assert page.complaints() == []
    assert done == ["abort", "live"]


@pytest.mark.parametrize("size", SIZES)
def test_the_acts_on_a_flight_stay_in_sight_and_an_answer_moves_nothing(
    browser: Any, make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch, size: tuple[int, int]
) -> None:
    folder = make_run("live")
    monkeypatch.setattr("alula.console.commands.is_live", lambda _run: True)
    link = Robot(pause=lambda: "held: " + "a skill that goes on, " * 40)
    pause = "[...document.querySelectorAll('#acts button')][0]"
    with served(folder, link) as console:
        page = Page(browser, console.address, size)
        page.wait(f"{pause} !== undefined && !{pause}.disabled && document.querySelector('.row') !== null")
        page.wait("![...document.querySelectorAll('#operator details')].at(-1).open")  # folded up at lift-off
        page.run("scrollTo(0, document.documentElement.scrollHeight / 2)")
        page.wait("document.querySelector('#acts').getBoundingClientRect().top === 0")
        buttons = "[...document.querySelectorAll('#acts button:not([hidden])')]"
        assert page.run(f"{buttons}.every((one) => one.getBoundingClientRect().top < 120)")
        page.run("scrollTo(0, 0)")
        before = page.run("document.querySelector('main').getBoundingClientRect().top")
        page.run(f"{pause}.click(), {pause}.click()")
        page.wait("document.querySelector('#acts output').textContent.includes('a skill that goes on')")
        assert page.run("document.querySelector('main').getBoundingClientRect().top") == before
        assert page.complaints() == []


def test_what_the_mission_needs_to_start_is_shown_and_turns_green(browser: Any, make_run: Callable[..., Path]) -> None:
    folder = make_run("live", story=[])
    ready, fence = ["the home point is valid", "the home point is not valid"], [f"a fence {HOSTILE}", ""]
    writer = write_record(folder, [(1.0, TICKS, {"unmet": [ready[1]], "conditions": [ready, fence]})], over=False)
    with served(folder) as console:
        page = Page(browser, console.address)
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
    monkeypatch.setattr("alula.console.commands.is_live", lambda _run: True)
    link = Robot(pause=lambda: done.append("pause") or "pause", resume=lambda: done.append("resume") or "resume")
    button = "[...document.querySelectorAll('#acts button')].find((one) => one.textContent === '{}' && !one.hidden && !one.disabled)"
    with served(folder, link) as console:
        page = Page(browser, console.address)
        page.wait(f"{button.format('pause')} !== undefined")
        assert page.run(f"{button.format('go on')} === undefined")
        page.run(f"{button.format('pause')}.click()")
        assert done == []
        page.run(f"{button.format('press again: pause')}.click()")
        page.wait("document.querySelector('#acts output').textContent === 'pause: pause'")
        writer.write(OPERATOR, round(33e9), {"command": "paused", "by": "mission", "reason": "navigation.goto holds"})
        page.wait("document.querySelector('.held').textContent === 'The mission is paused. navigation.goto holds'")
        page.wait("document.querySelector('#headline').textContent === 'The mission is paused'")
        page.run(f"{button.format('go on')}.click(), {button.format('press again: go on')}.click()")
        writer.write(OPERATOR, round(40e9), {"command": "resume", "by": "mission", "reason": ""})
        page.wait("document.querySelector('.held').textContent === ''")
        page.wait("document.querySelector('#lines').textContent.includes('The mission goes on, after ')")
        assert page.complaints() == []
    writer.close()
    assert done == ["pause", "resume"]


def test_what_was_sent_is_said_until_the_answer_comes_or_the_connection_breaks(
    browser: Any, make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, go = make_run("live"), threading.Event()
    monkeypatch.setattr("alula.console.commands.is_live", lambda _run: True)
    link = Robot(abort=lambda: "landing" if go.wait(WAIT_S) else "nothing came", pause=lambda: "paused")
    said, abort, pause = (
        "document.querySelector('#acts output').textContent",
        "document.querySelector('#acts .stop')",
        "document.querySelector('#acts .hold')",
    )
    with served(folder, link) as console:
        page = Page(browser, console.address)
        page.wait(f"{abort} !== null && !{abort}.disabled")
        page.run(f"{abort}.click(), {abort}.click()")
        page.wait(f"{said} === 'stop and land: sent …'")
        page.run(f"{pause}.click(), {pause}.click()")
        page.wait(f"{said}.startsWith('stop and land: sent')")  # an answer to another act hides no act that waits
        page.wait(f"{said}.startsWith('stop and land: sent, no answer for 3 s')")
        go.set()
        page.wait(f"{said} === 'stop and land: landing'")
        go.clear()
        page.run(f"{abort}.click(), {abort}.click()")
        page.wait(f"{said} === 'stop and land: sent …'")
        console.stop()
        page.wait(f"{said}.startsWith('stop and land: the connection broke before an answer came')")
        go.set()
        console.start()


NO_TIME = "\N{EN DASH}"
FIRST_SCREEN = (
    "#headline",
    "#readings",
    "#active",
    "#wrong",
    "#map",
    "#pictures img",
    "#recent",
    "#link",
    "#acts .hold",
    "#acts .stop",
)


def test_the_first_screen_shows_what_matters(browser: Any, make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("alula.console.commands.is_live", lambda _run: True)
    folder, start = make_run("live", story=[]), LIFT_OFF_S
    place, speed = {"x": 2.0, "y": -1.0, "z": 3.0}, {"x": 0.6, "y": 0.8, "z": 0.0}
    value = {"position_enu_m": place, "velocity_enu_m_s": speed, "mode": "GUIDED", "link": True, "battery_percent": 31.0}
    sample = {"skillset": "navigation", "data": "guidance_state", "value": value, "stamp_s": start + 31}
    ticks = {"unmet": [], "conditions": [["the LiDAR works", ""]]}
    story = [entry for entry in failing_story() if entry[0] < start + 31 and entry[1] != "/data"]
    (folder / "pictures.jsonl").write_text(
        json.dumps({"stamp_s": start + 30.5, "camera": "depth", "jpeg": "AAAA"}) + "\n", encoding="utf-8"
    )
    writer = write_record(folder, [(start - 4, TICKS, ticks)], over=False)
    with served(folder) as console:
        page = Page(browser, console.address, (1440, 900))
        before = "[...document.querySelectorAll('#operator details')].at(-1).open"
        page.wait(f"{before} && document.querySelector('#operator .checks li') !== null")
        for t_s, topic, entry in [*story, (start + 31, "/data", sample)]:
            writer.write(topic, round(t_s * 1e9), {**entry, "stamp_s": t_s} if topic == EVENTS else entry)
        page.wait("document.querySelector('.chain') !== null && document.querySelector('#pictures img') !== null")
        page.wait(f"!{before}")
        bottom = page.run("document.querySelector('#scrub').getBoundingClientRect().top")
        boxes = {name: page.run(f"document.querySelector({json.dumps(name)}).getBoundingClientRect().toJSON()") for name in FIRST_SCREEN}
        assert {name: box for name, box in boxes.items() if box["height"] < 10 or box["top"] < 0 or box["bottom"] > bottom} == {}
        told = dict(
            page.run("[...document.querySelectorAll('#readings div')].map((one) => [...one.children].map((part) => part.textContent))")
        )
        assert told == {
            "height": "3.0 m", "speed": "1.0 m/s", "battery": "31 %", "link": "autopilot up", "east, north of home": "2.0 m, -1.0 m",
            "in the air": "31.0 s", "waypoints": "0 of 5", "autopilot's mode": "GUIDED",
        }  # fmt: skip
        assert page.text("#active li") == "lidar_depthmapsince 30.5 s"
        assert page.text("#wrong li") == "zed_depthmap: invariant zed_ok violated (since 30.0 s) | zed_status is BROKEN (since 30.0 s)"
        assert page.text("#recent li").startswith("30.50 sperception.lidar_depthmap runs")
        hold, stop = (page.run(f"getComputedStyle(document.querySelector('#acts {kind}')).backgroundColor") for kind in (".hold", ".stop"))
        assert hold != stop
        assert min(boxes[name]["height"] for name in ("#acts .hold", "#acts .stop")) >= 44
        page.choose(10.0)
        assert page.text("#active li") == "zed_depthmapsince 1.0 s"
        assert page.text("#wrong li") == "Nothing is known to be wrong."
        assert page.complaints() == []
    writer.close()


@pytest.mark.parametrize("begin_s", [0.0, 1_795_438_396.0])
def test_what_came_before_the_mission_clock_has_no_time(browser: Any, make_run: Callable[..., Path], begin_s: float) -> None:
    story = [(begin_s + t_s, topic, value) for t_s, topic, value in failing_story()]
    story[-1][2]["end_s"] += begin_s
    early = {"scenario": "mapping", "outcome": "running", "reason": "", "waypoints": 5, "waypoints_reached": 0}
    folder = make_run("live", story=[(0.0, MISSION, early), (0.0, TREE, story[1][2]), *story])
    for stamp_s, command in ((0.0, "take"), (None, "start")):
        note_act(folder, stamp_s, {"command": command, "by": "me"})
    with served(folder) as console:
        page = Page(browser, console.address)
        page.wait("document.querySelectorAll('.chain').length === 1")
        assert page.run("[alula.run.begin, alula.run.end]") == pytest.approx([begin_s + LIFT_OFF_S - 3, begin_s + LIFT_OFF_S + 61])
        assert page.text("#lines li").startswith(
            f"{NO_TIME}The operator took command. | {NO_TIME}The operator started the mission. | 0.00 sLift-off."
        )
        assert page.text("#moments tbody tr").startswith(NO_TIME)
        times = page.run(
            "[...document.querySelectorAll('#timeline text, #lines button, #moments td:first-child')].map((one) => one.textContent)"
        )
        assert [text for text in times if re.search(r"\d{4}|NaN|Infinity", text)] == []
        page.run("document.querySelector('#lines button').click()")
        assert page.run("alula.moment()") == pytest.approx(begin_s + LIFT_OFF_S - 3)
        assert page.complaints() == []


def test_page_and_report_agree_to_the_last_digit(browser: Any, make_run: Callable[..., Path]) -> None:
    start = LIFT_OFF_S
    folder = make_run(
        "over",
        story=[
            *failing_story()[:-1],
            (start + 60, EVENTS, transition("navigation.flight_status", "IN_AIR", "ON_GROUND")),
            failing_story()[-1],
        ],
    )
    (folder / "summary.json").write_text(json.dumps({**SUMMARY, "lift_off": {"stamp_s": start - 0.3, "source": "simulator"}}))
    path = [(PATH, start + number / 5, [number / 5.0123, 1.04, 3.0]) for number in range(-5, 305)]
    health = (HEALTH, start + 29.93, {"sensor": "zed", "ok": False, "fault": "silent", "reason": "no image for 0.4 s"})
    write_report(folder, [*path, (FAULT, start + 29.9, {"sensor": "zed", "mode": "dead"}), health], title="over")
    parts = (
        "#headline",
        "#reason",
        "#figures-row",
        "#lines",
        "#chains",
        "#answers",
        "#map-words",
        "#readings",
        "#wrong",
        "#recent",
        "#moments",
        "#timeline",
        "#tree",
    )
    with served(folder) as console:
        seen = []
        for address in (console.address, f"file://{folder / 'report.html'}"):
            page = Page(browser, address)
            page.wait(DRAWN)
            page.wait("document.querySelector('#figures-row').textContent.includes('landed')")
            seen.append({part: page.text(part) for part in parts})
    seen[0]["#answers"] = seen[0]["#answers"].replace("look for it", "")  # of a report nobody can ask
    assert "m east" in seen[0]["#figures-row"]
    assert seen[0] == seen[1]


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
            "resources": [
                {
                    "name": "flight_status",
                    "state": "IN_AIR",
                    "reason": "not heard of for 4.1 s",
                    "targets": ["ON_GROUND"],
                    "every_target": ["IN_AIR", "ON_GROUND"],
                }
            ],
            "data": [{"name": "guidance_state", "value": HOSTILE, "age_s": 0.2, "stale": False}],
        }
    ],
}  # fmt: skip


class Listened:
    """Stands for the skillsets of a run."""

    def __init__(self, _skillsets: object) -> None:
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
    monkeypatch.setattr("alula.console.commands.is_live", lambda _run: True)
    monkeypatch.setattr("alula.console.commands.ManualControl", Listened)
    LISTENED.clear()
    link = Robot()
    monkeypatch.setattr(link, "listen", lambda _domain: None)
    with served(folder, link) as console:
        page = Page(browser, console.address, size)
        page.wait("document.querySelector('#manual') !== null && !document.querySelector('#manual').hidden && alula.live.state === 'live'")
        assert LISTENED == []
        page.browser.find_element("css selector", "#manual summary").send_keys(" ")  # a key of its own, not the one that plays
        assert page.run("document.querySelector('#play').getAttribute('aria-pressed')") != "true"
        page.wait("document.querySelectorAll('.skills li').length === 2")
        assert "could not start now:" in page.text(".needs")
        assert HOSTILE in page.text(".needs")
        assert page.text(".skill label b + .hint") == " float64, < h_geo_fence"
        height = page.browser.find_element("css selector", ".skill input")
        height.clear()
        height.send_keys("4.5")
        start = "document.querySelector('#manual form .go')"
        page.run(f"{start}.click()")
        assert page.run(f"{start}.textContent") == "press again: start takeoff"
        assert LISTENED[0].asked == []
        page.run(f"{start}.click()")
        page.wait("document.querySelector('#manual output').textContent.includes('done')")
        page.run("[...document.querySelectorAll('.pick')][1].click()")
        assert page.run("document.querySelector('.skills progress:not([style*=hidden])').value") == 0.5
        interrupt = "document.querySelector('.skill .danger')"
        page.run(f"{interrupt}.click(), {interrupt}.click()")
        assert page.text(".resources li .hint") == "not heard of for 4.1 s"
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
        page.run("document.querySelector('#manual summary').click()")
        page.wait("document.querySelector('#manual').open === false")
        end = time.monotonic() + WAIT_S
        while LISTENED[0].asked[-1] != {"act": "close"}:
            assert time.monotonic() < end
            page.run("new Promise((done) => setTimeout(done, 50))")
        assert page.complaints() == []
