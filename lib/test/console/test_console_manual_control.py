"""Manual control: over the page's socket, against a real skillset in another process."""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("skill_panel", reason="needs ROS 2")

pytest.importorskip("rclpy")
pytest.importorskip("navigation_interfaces.action")

from console_serving import WAIT_S, Bench, answer_to, heard, serve

from alula.common import run_log
from alula.common.runs import Run
from alula.console import commands, manual_control
from alula.console.acts import ActError
from alula.console.manual_control import ManualControl
from skill_panel.ros_link import RosLink
from skill_panel.watcher import wait_for

HOSTILE = "<script>document.title='owned'</script>"


@pytest.fixture(scope="module")
def skillset(ros2_domain: int) -> Iterator[int]:
    """Serve navigation; return its domain."""
    served = subprocess.Popen([sys.executable, str(Path(__file__).with_name("console_skillset.py"))], start_new_session=True)
    yield ros2_domain
    served.terminate()
    served.wait(60.0)


@pytest.fixture
def run_of(make_run: Callable[..., Path], skillset: int, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of a run that is under way in the skillset's domain."""
    folder = make_run("live")
    known = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    (folder / "run.json").write_text(json.dumps({**known, "domain": skillset}), encoding="utf-8")
    monkeypatch.setattr(commands, "is_live", lambda _run: True)
    monkeypatch.setattr(manual_control, "ANSWER_S", WAIT_S)
    return folder


def skill_of(message: dict[str, Any], name: str) -> dict[str, Any]:
    """Return a skill in a message; empty while it is not there."""
    shown = message.get("manual", {}).get("skillsets", [])
    return next((dict(skill) for one in shown for skill in one["skills"] if skill["name"] == name), {})


def resource_of(message: dict[str, Any], name: str) -> dict[str, Any]:
    shown = message.get("manual", {}).get("skillsets", [])
    return next((dict(resource) for one in shown for resource in one["resources"] if resource["name"] == name), {})


async def make_ready(viewer: Any) -> None:
    """Take the transitions that a takeoff needs."""
    for resource, to in (("SDK_authority", "AVAILABLE"), ("homepoint_status", "VALID")):
        seen = await heard(viewer, lambda message, name=resource: bool(resource_of(message, name)))  # type: ignore[misc]
        if resource_of(seen, resource)["state"] != to:
            asked = {"act": "transition", "root": "/navigation", "resource": resource, "to": to}
            assert await answer_to(viewer, command="skill", run="live", **asked) == f"{resource} is {to}"
    await heard(viewer, lambda message: skill_of(message, "takeoff").get("unmet") == [])


def test_skills_are_shown_started_paused_interrupted_and_the_record_says_so(run_of: Path) -> None:
    async def play(bench: Bench) -> None:
        viewer = await bench.viewer("me", manual=True)
        ask = lambda act, **more: answer_to(viewer, command="skill", run="live", act=act, root="/navigation", skill="takeoff", **more)  # noqa: E731
        takeoff = skill_of(await heard(viewer, lambda message: bool(skill_of(message, "takeoff"))), "takeoff")
        assert [(one["name"], one["kind"], one["said"]) for one in takeoff["inputs"]] == [
            ("height", "float64", "m, < h_geo_fence"),
            ("speed", "float64", "m/s"),
        ]
        assert any("SDK_authority" in reason for reason in takeoff["unmet"])
        await make_ready(viewer)
        texts = {"height": "3.0", "speed": "1.5"}
        assert await ask("why", texts=texts) != ""
        assert "too high" in await ask("why", texts={**texts, "height": "200"})
        assert await ask("start", texts={**texts, "height": "200"}) == "NOT_VALIDATED too high"
        assert await ask("start", texts={**texts, "height": "high"}) == "refused: height: 'high' is no number"
        assert await ask("start", texts=texts) == "takeoff is RUNNING"
        await heard(viewer, lambda message: [one["progress"] for one in skill_of(message, "takeoff").get("running", [])] == [0.5])
        assert await ask("pause") == "paused"
        await heard(viewer, lambda message: [one["state"] for one in skill_of(message, "takeoff").get("running", [])] == ["PAUSED"])
        assert await ask("resume") == "goes on"
        assert await ask("interrupt") == "1 execution told to end"
        ended = await heard(viewer, lambda message: (skill_of(message, "takeoff").get("last") or {}).get("state") == "INTERRUPTED")
        assert skill_of(ended, "takeoff")["last"]["inputs"] == {"height": 3.0, "speed": 1.5}
        assert await ask("interrupt") == "nothing runs of it"

    serve(play, fixed=run_of, link=RosLink())
    acts = run_log.read(run_of, run_log.ACT)
    done = [(act["command"], act["answer"]) for act in acts if "takeoff" in act["command"]]
    assert ("start navigation.takeoff, height 3.0, speed 1.5", "takeoff is RUNNING") in done
    assert ("interrupt navigation.takeoff", "1 execution told to end") in done
    assert not [command for command, _ in done if command.startswith("why")]


def test_a_viewer_without_control_drives_nothing_and_one_that_does_not_look_is_sent_nothing(run_of: Path) -> None:
    async def play(bench: Bench) -> None:
        first = await bench.viewer("first", manual=True)
        await heard(first, lambda message: bool(skill_of(message, "hover")))
        second = await bench.viewer("second")
        asked = {"command": "skill", "run": "live", "act": "interrupt", "root": "/navigation", "skill": "hover"}
        assert await answer_to(second, **asked) == "refused: you watch; take over first"
        assert "another one by now" in await answer_to(first, **{**asked, "run": "an older one"})
        for _ in range(3):
            assert "manual" not in await heard(second, lambda message: "status" in message or "manual" in message)

    serve(play, fixed=run_of, link=RosLink())


def test_listening_ends_with_the_last_viewer_that_looks(run_of: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    closed: list[bool] = []
    close = ManualControl.close
    monkeypatch.setattr(ManualControl, "close", lambda self: (closed.append(True), close(self))[1])

    async def play(bench: Bench) -> None:
        viewer = await bench.viewer("me", manual=True)
        await heard(viewer, lambda message: bool(skill_of(message, "hover")))
        assert closed == []
        await viewer.send(json.dumps({"manual": False}))
        async with asyncio.timeout(WAIT_S):
            while not closed:
                await heard(viewer, lambda message: "status" in message)

    serve(play, fixed=run_of, link=RosLink())


@pytest.mark.parametrize(
    ("asked", "why"),
    [
        ({}, "there is no skillset None in this run; there are /navigation"),
        ({"root": HOSTILE, "act": "start"}, "there is no skillset"),
        ({"root": "/navigation"}, "there is no act None; there are start, interrupt, pause, resume, why, transition"),
        ({"root": "/navigation", "act": ["start"]}, "there is no act"),
        ({"root": "/navigation", "act": "start", "skill": HOSTILE}, "has no skill <script>"),
        ({"root": "/navigation", "act": "start", "skill": {"a": 1}}, "has no skill"),
        ({"root": "/navigation", "act": "start", "skill": "hover"}, "hover takes duration .float64, s, > 0., each as a text"),
        ({"root": "/navigation", "act": "start", "skill": "hover", "texts": {"duration": 3}}, "each as a text"),
        ({"root": "/navigation", "act": "start", "skill": "hover", "texts": {"duration": "9" * 3000}}, "longer than 2000"),
        ({"root": "/navigation", "act": "start", "skill": "hover", "texts": {"duration": HOSTILE}}, "is no number"),
    ],
)
def test_acts_that_make_no_sense_are_refused(manual: ManualControl, asked: dict[str, Any], why: str) -> None:
    with pytest.raises(ActError, match=why):
        manual.do(asked)


@pytest.mark.parametrize(("resource", "to"), [("axes_authority", "USED"), ("nothing", "AVAILABLE"), (HOSTILE, HOSTILE)])
def test_transitions_that_the_model_lacks_are_refused_by_the_managers(manual: ManualControl, resource: str, to: str) -> None:
    what, answer = manual.do({"root": "/navigation", "act": "transition", "resource": resource, "to": to})
    assert what == f"transition navigation.{resource} to {to}"
    assert answer.startswith("refused: ")


def test_progress_is_shown_of_an_execution_that_another_client_started(manual: ManualControl, skillset: int) -> None:
    def takeoff() -> dict[str, Any]:
        return skill_of({"manual": manual.describe()}, "takeoff")

    mission = ManualControl(RosLink().listen(Run(Path(), skillset)))
    try:
        assert wait_for(lambda: bool(mission.describe()["skillsets"]), WAIT_S)
        for resource, to in (("SDK_authority", "AVAILABLE"), ("homepoint_status", "VALID")):
            mission.do({"root": "/navigation", "act": "transition", "resource": resource, "to": to})
        assert wait_for(lambda: takeoff()["unmet"] == [], WAIT_S)
        asked = {"root": "/navigation", "skill": "takeoff", "texts": {"height": "3.0", "speed": "1.0"}}
        assert mission.do({**asked, "act": "start"})[1] == "takeoff is RUNNING"
        assert wait_for(lambda: [one["progress"] for one in takeoff()["running"]] == [0.5], WAIT_S)
        mission.do({**asked, "act": "interrupt"})
        assert wait_for(lambda: takeoff()["running"] == [], WAIT_S)
    finally:
        mission.close()


@pytest.fixture(scope="module")
def manual(skillset: int) -> Iterator[ManualControl]:
    made = ManualControl(RosLink().listen(Run(Path(), skillset)))
    assert wait_for(lambda: bool(made.describe()["skillsets"]), WAIT_S)
    yield made
    made.close()
