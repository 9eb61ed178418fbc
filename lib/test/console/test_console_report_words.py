"""What the report says in words: what became of a fallback, what is not measured any more, where the vehicle landed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from console_page import DRAWN, Page
from console_records import LIFT_OFF_S, failing_story, overtaken
from console_reports import SUMMARY, make_report, make_story_report

from alula.common.record import DATA, MISSION
from alula.report.page.embedded import REPORT
from alula.report.page.entries import HEALTH
from alula.report.page.writing import write_report

TIMES = "[...document.querySelectorAll('.chain')].map((one) => [...one.querySelectorAll('button')].map((b) => parseFloat(b.textContent)))"
"""The times of each chain of causes."""


def test_a_fallback_that_ended_badly_is_told_with_how_long_it_held(browser: Any, tmp_path: Path) -> None:
    page = Page(browser, make_story_report(tmp_path, *overtaken()))
    page.wait(DRAWN)
    lines = page.text("#lines li").split(" | ")
    assert "43.04 sThe fallback runs: hover; it held for 1.96 s, then the autopilot changed to RTL." in lines
    assert "safe" not in page.text("#lines")
    assert "the fallback ran after 3.04 s; it held for 1.96 s, then the autopilot changed to RTL" in page.text("#answers td")
    assert page.complaints() == []


def test_since_when_something_is_wrong_stands_apart_from_its_causes(browser: Any, tmp_path: Path) -> None:
    reason = "left image is dark (mean 3): too little light, or a covered lens"
    finding = (HEALTH, LIFT_OFF_S + 29.0, {"sensor": "zed", "ok": False, "fault": "exposure", "reason": reason})
    page = Page(browser, make_report(tmp_path, recordings=[finding]))
    page.wait(DRAWN)
    page.choose(29.5)
    assert page.text("#wrong li") == f"zed: {reason} (since 29.0 s)"
    assert page.complaints() == []


UNASKED = {
    "ground_station": (
        "the process ground_station died",
        "ground_station died",
        ["The process ground_station died: signal SIGSEGV; it stayed dead."],
    ),
    "encoder": (
        "the process encoder died",
        "encoder died",
        ["The process encoder died: signal SIGSEGV; it ran again after 1.5 s."],
    ),
    "radio": ("radio was lost", "radio lost", ["The radio was lost.", "The radio works again."]),
}
"""Of what failed without being made to: its name, its mark on the timeline, and what is told of it."""


@pytest.mark.parametrize("sensor", UNASKED)
def test_what_failed_without_being_made_to_is_the_cause_of_what_followed(browser: Any, tmp_path: Path, sensor: str) -> None:
    what, mark, sentences = UNASKED[sensor]
    story, summary = overtaken()
    (answer,) = summary["answers"]
    again_s = 41.5 if sensor == "encoder" else None
    died = [] if sensor == "radio" else [{"name": sensor, "when_s": 40.0, "how": "signal SIGSEGV", "again_s": again_s}]
    mode, until_s = ("died", again_s) if died else ("", 50.0)
    summary |= {"answers": [{**answer, "sensor": sensor, "mode": mode, "injected": False, "until_s": until_s}], "died": died}
    page = Page(browser, make_story_report(tmp_path, [entry for entry in story if entry[1] != "/fault"], summary))
    page.wait(DRAWN)
    assert page.text("#answers tbody tr").startswith(what)
    assert "injected" not in page.text("#answers tbody")
    assert page.text(".chain li").startswith(f"failure40.00 s{what}")
    assert f"{mark} 40.00 s" in page.text("#timeline text").split(" | ")
    told = [line for line in page.text("#lines li").split(" | ") if line.startswith(("40.00 s", "50.00 s"))]
    assert told == [f"{when}{sentence}" for when, sentence in zip(("40.00 s", "50.00 s"), sentences, strict=False)]
    assert page.complaints() == []


def test_a_mission_that_was_killed_is_told_to_be_aborted_with_who_ended_it(browser: Any, tmp_path: Path) -> None:
    story = failing_story()[:-1]  # its record never tells its end
    reason = "ended by the supervisor: mission died (signal SIGKILL)"
    page = Page(browser, make_story_report(tmp_path, story, {**SUMMARY, "outcome": "aborted", "reason": reason}))
    page.wait(DRAWN)
    assert page.text("#headline") == "Mission aborted"
    assert reason in page.text("body")
    assert "59.80 sMission aborted." in page.text("#lines li").split(" | "), "told where its record ends"
    assert page.complaints() == []


def test_a_fallback_that_holds_is_only_named(browser: Any, tmp_path: Path) -> None:
    page = Page(browser, make_report(tmp_path))
    page.wait(DRAWN)
    assert "30.50 sThe fallback runs: lidar_depthmap." in page.text("#lines li").split(" | ")


def test_what_happened_tells_the_detection_and_the_autopilots_act_in_their_places(browser: Any, tmp_path: Path) -> None:
    page = Page(browser, make_story_report(tmp_path, *overtaken()))
    page.wait(DRAWN)
    lines = page.text("#lines li").split(" | ")
    wanted = [
        "40.00 sThe ground station was made to fail (killed).",
        "41.00 svideo.link: UP → DOWN, reported by the functional layer.",
        "43.00 svideo.stream was stopped",
        "45.00 sThe autopilot changed to RTL",  # before what it took: the loss of the authority tells when it was
        "45.00 snavigation.hover was stopped",
        "57.00 sLanded.",
    ]
    places = [next(at for at, line in enumerate(lines) if line.startswith(start)) for start in wanted]
    assert places == sorted(places)


def test_a_chain_of_causes_is_in_the_order_of_time(browser: Any, tmp_path: Path) -> None:
    page = Page(browser, make_story_report(tmp_path, *overtaken()))
    page.wait(DRAWN)
    chains = page.run(TIMES)
    assert len(chains) == 3
    assert chains == [sorted(times) for times in chains]
    assert page.text(".chain b").split(" | ")[:4] == ["failure", "resource", "measurement", "invariant"]


@pytest.mark.parametrize(
    ("landed", "where"),
    [
        ((0.3, 0.2), "0.4 m from home"),
        ((12.04, -0.01), "12.0 m east, 0.0 m north of home, at waypoint 2"),
        ((-3.0, -4.5), "3.0 m west, 4.5 m south of home"),
    ],
)
def test_the_report_says_where_the_vehicle_landed(browser: Any, tmp_path: Path, landed: tuple[float, float], where: str) -> None:
    story, summary = overtaken()
    places = [(LIFT_OFF_S + t_s, "/path", place) for t_s, place in ((-1.0, [0, 0, 0]), (30.0, [6, 0, 3]), (56.5, [*landed, 0]))]
    make_story_report(tmp_path, [*story, *places], summary)  # type: ignore[list-item]
    write_report(tmp_path, [(topic, t_s, place) for t_s, topic, place in places], title="inspection")
    page = Page(browser, f"file://{tmp_path / REPORT}")
    page.wait(DRAWN)
    assert page.text("#figures-row div").startswith(f"landed{where}")
    assert f"57.00 sLanded, {where}." in page.text("#lines li").split(" | ")
    assert f"Landed {where}." in page.text("#map-words")
    page.choose(40.0)
    assert "Landed" not in page.text("#map-words")
    assert "No position since 30.0 s; the last one: Robot at east 6.0 m" in page.text("#map-words")
    assert page.complaints() == []


def video(t_s: float, **value: Any) -> tuple[float, str, dict[str, Any]]:
    figures = {"fps": 17.0, "quality": 0.93, "bit_rate_bps": 1.2e6, "delay_s": 0.21, "loss": 0.015, "streaming": True, **value}
    return (LIFT_OFF_S + t_s, DATA, {"skillset": "video", "data": "picture", "value": figures, "stamp_s": 1.0})


def test_a_figure_that_is_not_measured_any_more_is_a_gap(browser: Any, tmp_path: Path) -> None:
    samples = [
        *[video(step / 2) for step in range(20)],
        *[video(step / 2, fps=0.0) for step in range(20, 60)],  # the quality and so on are repeated
        *[video(step / 2, fps=0.0, streaming=False) for step in range(60, 80)],
    ]
    told = (LIFT_OFF_S + 1, "picture", {"stamp_s": LIFT_OFF_S + 1, "camera": "screen", "jpeg": "AAAA"})
    (tmp_path / "pictures.jsonl").write_text(json.dumps(told[2]) + "\n", encoding="ascii")
    page = Page(browser, make_report(tmp_path, sorted([*failing_story(), *samples], key=lambda entry: entry[0])))
    page.wait(DRAWN)
    said = {}
    for t_s in (9.6, 20.0, 35.0, 61.0):
        page.choose(t_s)
        said[t_s] = (page.text("#charts figcaption").split(" | "), page.text("#pictures .hint"))
    assert said[9.6][1] == "17 frames/s, 0.93 SSIM, 1200 kbit/s, 0.21 s delay, 1.5 % lost"
    assert "video.picture.fps0 frames/s" in said[20.0][0]
    assert "video.picture.qualityno data since 9.5 s" in said[20.0][0]
    assert said[20.0][1] == "0 frames/s, 1200 kbit/s; no data since 9.5 s: quality, delay, loss"
    assert "video.picture.fpsno data since 29.5 s" in said[35.0][0]
    assert "navigation.guidance_state.distance_to_go_m0.2 m" in said[61.0][0]
    ends = page.run(
        "Object.fromEntries([...document.querySelectorAll('figure svg')].filter((one) => one.querySelector('path')).map((one) =>"
        "[one.getAttribute('aria-label'), Number(/([\\d.]+) [\\d.]+$/.exec(one.querySelector('path').getAttribute('d'))[1])]))"
    )
    names = ("video.picture.quality", "video.picture.fps", "navigation.guidance_state.distance_to_go_m")
    quality, rate, distance = (ends[f"{name} in time"] for name in names)
    assert quality < rate < distance


def test_a_robot_that_names_no_figures_has_the_first_that_change(browser: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "robot.yaml").write_text("name: arm\n", encoding="utf-8")
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path))
    told = [{"still": 1.0, "joints": {"a": t_s, "b": -t_s, "c": t_s % 3}, "last": t_s, "text": "x"} for t_s in map(float, range(20))]
    samples = [
        (LIFT_OFF_S + t_s, DATA, {"skillset": "arm", "data": "pose", "value": value, "stamp_s": 1.0}) for t_s, value in enumerate(told)
    ]
    others = [entry for entry in failing_story() if entry[1] != DATA]
    page = Page(browser, make_report(tmp_path, sorted([*others, *samples], key=lambda entry: entry[0]), recordings=[]))
    page.wait(DRAWN)
    page.choose(10.0)
    drawn = [one for one in page.text("#charts figcaption").split(" | ") if one.startswith("arm.")]
    assert drawn == ["arm.pose.joints.a10 ", "arm.pose.joints.b-10 ", "arm.pose.joints.c1 "]
    assert page.complaints() == []


def test_a_plot_is_interrupted_where_no_data_came(browser: Any, tmp_path: Path) -> None:
    kept = [entry for entry in failing_story() if entry[1] != DATA or not LIFT_OFF_S + 20 < entry[0] < LIFT_OFF_S + 40]
    page = Page(browser, make_report(tmp_path, kept))
    page.wait(DRAWN)
    drawn = page.run("document.querySelector('figure svg path').getAttribute('d')")
    assert drawn.count("M") == 2
    page.choose(30.0)
    assert "ground speedno data since 20.0 s" in page.text("#charts figcaption")


def test_the_player_names_its_speed_and_stops_at_each_of_several_events(browser: Any, tmp_path: Path) -> None:
    page = Page(browser, make_report(tmp_path))
    page.wait(DRAWN)
    assert page.text("#speed") == "5\N{MULTIPLICATION SIGN}"
    labels = "['previous', 'play', 'next'].map((id) => document.getElementById(id).getAttribute('aria-label'))"
    assert page.run(labels) == ["previous event", "play, 5 times as fast as it was", "next event"]
    seen = "filter((one) => getComputedStyle(one).display !== 'none')"
    signs = f"[...document.querySelectorAll('#play path')].{seen}.map((one) => one.classList[0])"
    assert page.run(signs) == ["go"]
    page.run("document.querySelector('#play').click()")
    page.wait("document.querySelector('#play').getAttribute('aria-label') === 'pause'")
    assert page.run(signs) == ["hold"]
    page.run("document.querySelector('#play').click()")
    assert page.run(signs) == ["go"]
    page.choose(29.95)
    shown = []
    for _ in range(4):
        page.run("alula.step(1)")
        page.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        shown.append(page.text("#at"))
    assert [text.startswith(f"30.00 s ({number} of 3)") for number, text in enumerate(shown[:3], 1)] == [True] * 3
    assert len(set(shown)) == 4
    page.run("alula.step(-1)")
    page.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert page.text("#at") == shown[2]
    assert page.text("tr.current td").startswith("30.00 s")


def test_the_bottom_line_says_the_words_first_and_wraps(browser: Any, tmp_path: Path) -> None:
    story = [entry for entry in failing_story() if entry[1] != MISSION]
    reason = (
        "video.stream: RESOURCE_INVARIANT_VIOLATED enough_frames (picture.fps_margin is -8.0 for 1 s); then navigation.land: NOT_READY "
        "sdk_authority (SDK_authority is UNAVAILABLE (extern)) (the vehicle is in RTL: the pilot or a failsafe has it)"
    )
    page = Page(browser, make_report(tmp_path, [*story, (LIFT_OFF_S + 61, MISSION, {"outcome": "given_up", "reason": reason})]), (390, 844))
    page.wait(DRAWN)
    page.choose(61.0)
    assert page.text("#at").endswith(
        "mission given up: video.stream: frames per second: 8.0 below the limit for 1 s (resource invariant violated enough_frames); then "
        "navigation.land: SDK_authority is UNAVAILABLE (extern) (not ready sdk_authority) "
        "(the vehicle is in RTL: the pilot or a failsafe has it)"
    )
    assert page.run("document.querySelector('#at').title") != ""
    line = page.run("parseFloat(getComputedStyle(document.querySelector('#at')).lineHeight)")
    assert page.run("document.querySelector('#at').clientHeight") == pytest.approx(2 * line)
    told = page.run("alula.run.moments.map(({ text }) => text)")
    assert [text for text in told if "zed_depthmap invariant violated: zed_status is BROKEN" in text and text.endswith("(zed_ok)")]


def test_words_and_signs_are_explained(browser: Any, tmp_path: Path) -> None:
    page = Page(browser, make_report(tmp_path))
    page.wait(DRAWN)
    terms = "skill | resource | precondition | invariant | mission tree | fallback | authority | RTL | SSIM | rmse | coverage"
    assert page.text("#glossary dt") == terms
    assert page.run("document.querySelectorAll('#glossary dd').length") == len(terms.split(" | "))
    assert page.run("document.querySelector('#glossary').open") is False
    first = "[...new Set([...document.querySelectorAll('.row .box')].map((one) => one.textContent[0]))]"
    signs = {letter for letter in page.run(first) if not letter.isalnum()}
    assert signs == {"→", "?", "⇉"}
    assert signs <= set(page.text("#tree-legend"))
