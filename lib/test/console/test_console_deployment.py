"""A deployment that is up, on the page: what runs, its skills without a mission, and that acts on missions are not for it."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from console_page import SIZES, Page
from console_serving import Bench, Robot, answer_to, heard, serve, served

from alula.common.network import claim_domain
from alula.console.link import Skillsets
from alula.report.page.following import RunFollower

PARTS = {"bridge": ("running", ""), "rover": ("running", ""), "recorder": ("given up", "exit code 1: the disk is full")}


class Up:
    """A deployment, lab, as its keeper tells of it."""

    def __init__(self, folder: Path, domain: int, run_id: str) -> None:
        self.folder = folder
        folder.mkdir(parents=True)
        known = {"scenario": "", "deployment": "lab", "domain": domain, "namespace": "", "run_id": run_id, "robot": "/robots/rover"}
        (folder / "run.json").write_text(json.dumps(known), encoding="utf-8")
        self.tell()

    def tell(self, problem: str = "", ahead_s: float = -0.25) -> None:
        parts = {
            name: {"pid": 7, "start": "boot 1", "state": state, "words": [], "graph": {}, "deaths": 0, "why": why}
            for name, (state, why) in PARTS.items()
        }
        master = {"uri": "http://192.168.1.10:11311", "problem": problem, "ahead_s": ahead_s, "within_s": 0.002}
        (self.folder / "state.json").write_text(json.dumps({"parts": parts, "master": master, "disk": "1.2 GB are free"}), encoding="utf-8")


@pytest.fixture
def up(tmp_path: Path, make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> Iterator[Up]:
    """A deployment that is up, after a mission that is over; this process is what carries its id."""
    monkeypatch.setenv("ALULA_ROBOT_STATE", str(tmp_path / "state"))
    make_run("20260101-patrol")
    claim = claim_domain()
    run_id = f"up-{os.getpid()}"
    monkeypatch.setattr("alula.common.runs.processes_of_run", lambda known: [os.getpid()] if known == run_id else [])
    yield Up(tmp_path / "state/up/lab", claim.domain, run_id)
    claim.release()


class Hands(Robot):
    """A link with no skillset that answers yet."""

    def listen(self, run: Any) -> Skillsets:
        assert run.folder.name == "lab"
        return self  # type: ignore[return-value]

    watched: tuple[()] = ()
    problems: tuple[()] = ()
    now_ns = 0


def test_it_is_shown_before_missions_that_are_over_and_acts_on_missions_are_refused(up: Up) -> None:
    robot = Hands(abort=lambda: "aborted")

    async def play(bench: Bench) -> None:
        viewer = await bench.viewer("me", manual=True)
        told = await heard(viewer, lambda message: message.get("status", {}).get("run") == "deployment lab")
        assert (told["status"]["live"], told["status"]["deployment"]) == (True, True)
        assert told["status"]["runs"] == ["20260101-patrol", "deployment lab"]
        assert told["status"]["underWay"] == ["deployment lab"]
        await heard(viewer, lambda message: message.get("manual", {}).get("run") == "deployment lab")
        for act in ("abort", "off"):
            assert "choose the mission's run" in await answer_to(viewer, command=act, run="deployment lab")
        (up.folder / "run.json").unlink()
        await heard(viewer, lambda message: message.get("status", {}).get("runs") == ["20260101-patrol"])

    serve(play, link=robot)


def test_what_runs_of_it_is_told_and_told_again_when_it_changes(up: Up) -> None:
    follower = RunFollower(up.folder)
    (first,) = [value for topic, _, value in follower.poll() if topic == "/parts"]
    assert [(one["name"], one["state"]) for one in first["parts"]] == [(name, state) for name, (state, _) in PARTS.items()]
    assert first["master"]["ahead_s"] == -0.25
    assert follower.poll() == []
    up.tell(problem="nothing answers within 3 s")
    (again,) = [value for topic, _, value in follower.poll() if topic == "/parts"]
    assert again["master"]["problem"] == "nothing answers within 3 s"


def test_the_page_of_a_deployment(browser: Any, up: Up, tmp_path: Path) -> None:
    with served(up.folder, link=Hands()) as console:
        page = Page(browser, console.address, SIZES[0])
        page.wait("document.querySelector('#readings div') !== null && alula.live.state === 'live'")
        page.wait("document.querySelector('#manual').open")
        page.wait("document.querySelector('#headline').textContent === 'lab is up, but for 1 of 3 parts'")
        assert page.text("#active") == "no mission"
        assert page.run("getComputedStyle(document.querySelector('#map-card')).display") == "none", "there is nothing on the map"
        tiles = page.text("#readings dt") + " / " + page.text("#readings dd")
        assert "bridge | rover | recorder | link to the ROS master | clock of its computer" in tiles
        assert "given up | up | \u22120.250 s" in tiles
        wrong = page.text("#wrong li")
        assert "recorder does not run (given up): exit code 1: the disk is full" in wrong
        assert "the clocks of the two computers are 0.250 s apart" in wrong
        assert page.run("document.querySelector('#acts .danger:not(:disabled)') === null"), "no act on a mission"
        assert not page.run("document.querySelector('#operator form .go').disabled"), "a mission can be started"
        up.tell(problem="nothing answers within 3 s")
        page.wait("document.querySelector('#wrong').textContent.includes('nothing answers within 3 s')")
        assert page.complaints() == []
