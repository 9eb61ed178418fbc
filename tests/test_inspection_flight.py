"""The inspection through the whole stack: a wall where the radio gets worse until the telepilot sees too little; processes that die."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from alula_testing.flights import Flight, start_flight

pytestmark = [pytest.mark.flight, pytest.mark.timeout(1200)]
WORLD = Path(__file__).with_name("worlds") / "small_building.yaml"
Summary = dict[str, Any]


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Flight]:
    started = start_flight(tmp_path_factory.mktemp("flight") / "run", "--rate", "0", "--world", str(WORLD), scenario="inspection")
    yield started
    started.give_up()


@pytest.fixture(scope="module")
def summary(flight: Flight) -> Summary:
    flight.end(0)
    return flight.summary


def only(summary: Summary, skill: str) -> Summary:
    (found,) = [execution for execution in summary["skills"] if execution["skill"] == skill]
    return found


def test_the_lost_video_ends_the_flight_safely(summary: Summary) -> None:
    assert summary["outcome"] == "degraded"
    assert summary["landed"] is True
    assert summary["collisions"] == 0
    assert summary["problems"] == []


def test_stream_fails_by_its_criterion_then_stop_hover_land(summary: Summary) -> None:
    stream, hover, land = (only(summary, skill) for skill in ("stream", "hover", "land"))
    goto = [execution for execution in summary["skills"] if execution["skill"] == "goto"][-1]
    assert (stream["outcome"], stream["result"]) == ("RESOURCE_INVARIANT_VIOLATED", "enough_frames")
    assert (goto["outcome"], hover["result"], land["result"]) == ("INTERRUPTED", "DONE", "LANDED")
    assert stream["end_s"] <= goto["end_s"] <= hover["running_s"] < land["running_s"]
    assert hover["running_s"] - stream["end_s"] <= 1.0


def test_a_degraded_zone_only_worsens_the_picture(flight: Flight, summary: Summary) -> None:
    zones = {(z["quality"], z["cause"]): z["t_s"] for z in lines(flight, "radio.jsonl")}
    begins = [zones[key] for key in (("degraded", "in the shadow"), ("critical", "no way through"))]
    degraded_s, critical_s = (begin_s - summary["lift_off"]["stamp_s"] for begin_s in begins)
    assert only(summary, "stream")["end_s"] > critical_s
    frames = lines(flight, "frames.jsonl")
    good, degraded = (
        [f for f in frames if f["shown"] is not None and begin + 1.0 < f["shown"] < end]
        for begin, end in ((degraded_s - 4.0, degraded_s), (degraded_s, critical_s))
    )
    bits = [8 * sum(f["bytes"] for f in part) / (part[-1]["sent"] - part[0]["sent"]) for part in (good, degraded)]
    assert bits[0] > 1e6
    assert bits[1] < 700e3
    assert np.mean(similarities(degraded)) < np.mean(similarities(good))


def test_the_summary_can_be_computed_again_from_the_records(flight: Flight, summary: Summary) -> None:
    video, end_s = summary["video"], only(summary, "stream")["end_s"]
    shown = [f for f in lines(flight, "frames.jsonl") if f["shown"] is not None and f["shown"] <= end_s]
    times = [f["shown"] for f in shown]
    edges = np.arange(times[0], end_s + 1e-9, 1.0)
    counts = np.histogram(times, edges)[0]
    assert video["min_fps"] == counts.min()
    assert video["mean_ssim"] == pytest.approx(np.mean(similarities(shown)), rel=0.02)
    assert video["freezes"] == sum(b - a > 0.5 for a, b in pairwise([*times, end_s]))
    assert video["criterion"] == "enough_frames"


def test_the_pictures_of_the_report_are_there(flight: Flight, summary: Summary) -> None:
    del summary
    for name in ("video.svg", "timeline.svg", "tree.svg", "map.png", "video/sent.mkv", "video/received.mkv", "video/stream.sdp"):
        assert (flight.out / name).stat().st_size > 0, name


@pytest.fixture
def killed(tmp_path: Path) -> Iterator[Callable[[str], tuple[Flight, Summary]]]:
    """Return what flies with a fault of a process, and lands."""
    started: list[Flight] = []

    def fly(fault: str) -> tuple[Flight, Summary]:
        flight = start_flight(tmp_path / "run", "--rate", "0", "--world", str(WORLD), "--fail", fault, scenario="inspection")
        started.append(flight)
        flight.end()
        assert (flight.summary["landed"], flight.summary["collisions"]) == (True, 0), flight.words()
        return flight, flight.summary

    yield fly
    for flight in started:
        flight.give_up()


def test_a_killed_encoder_is_not_told_as_a_bad_radio(killed: Callable[[str], tuple[Flight, Summary]]) -> None:
    flight, summary = killed("encoder@6")
    stream = only(summary, "stream")
    assert (stream["outcome"], stream["result"]) == ("TERMINATED", "LOST")
    assert "video encoder" in stream["message"]
    assert summary["outcome"] == "degraded"
    assert summary["video"]["criterion"] is None
    assert [(fault["sensor"], fault["mode"]) for fault in summary["injected"]] == [("encoder", "killed")]
    assert [death["name"] for death in summary["died"]] == ["video_stream"], "it was not started again"
    recovery = summary["recovery"]
    assert recovery["failure_s"] == pytest.approx(6.0, abs=0.1)
    assert recovery["fallback_running_s"] - recovery["failure_s"] < 2.5
    assert "encoder failed at 6.0" in flight.words()


def test_without_the_ground_station_the_autopilot_flies_home(
    killed: Callable[[str], tuple[Flight, Summary]],
) -> None:
    flight, summary = killed("ground_station@6")
    stream = only(summary, "stream")
    # The criterion is missed 4.5 to 4.7 s after the death, the failsafe comes 4.5 to 5 s after it: either may be first.
    assert (stream["outcome"], stream["result"]) in {("RESOURCE_INVARIANT_VIOLATED", "enough_frames"), ("INTERRUPTED", "")}
    assert 10.0 < stream["end_s"] < 12.0
    assert summary["outcome"] == "given_up"
    assert "RTL" in summary["reason"]
    assert [death["name"] for death in summary["died"]] == ["ground_station"]
    assert "ground_station failed at 6.0" in flight.words()


def similarities(frames: list[dict[str, Any]]) -> list[float]:
    """The SSIM of the frames: each has one, however late its reference comes."""
    found = [f["ssim"] for f in frames]
    assert found
    assert None not in found
    return found


def lines(flight: Flight, name: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (flight.out / "video" / name).read_text().splitlines()]
