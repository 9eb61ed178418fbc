"""The server as its viewers, good and bad, meet it: over real sockets on loopback."""

from __future__ import annotations

import asyncio
import itertools
import json
import os
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from console_records import failing_story, write_record
from console_serving import OPTIONS, WAIT_S, Bench, Robot, answer_to, heard, serve
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from alula.cli.console import main
from alula.common import run_log
from alula.common.record import EVENTS, MISSION, OPERATOR
from alula.common.robots import load_robot_folder
from alula.common.runs import Run
from alula.console import acts, commands, server
from alula.console.acts import ActError, WantedRun, read_wanted
from alula.console.admission import is_loopback
from alula.console.server import FEED, MAX_COMMANDS_PER_S, MAX_MESSAGE_BYTES
from alula.report import aborts


def events_in(message: dict[str, Any]) -> int:
    return sum(entry[0] == EVENTS for entry in message.get("entries", []))


def test_viewers_follow_a_run_that_grows(make_run: Callable[..., Path]) -> None:
    folder = make_run("growing", story=failing_story()[:3])
    (folder / "skills.mcap").unlink()
    writer = write_record(folder, failing_story()[:3], over=False)

    async def play(bench: Bench) -> None:
        viewers = [await bench.viewer(name) for name in ("one", "two")]
        for viewer in viewers:
            await heard(viewer, lambda message: events_in(message) == 1)
        writer.write(EVENTS, 1, failing_story()[3][2])
        for viewer in viewers:
            assert events_in(await heard(viewer, lambda message: "entries" in message)) == 1
        writer.close()

    serve(play, fixed=folder)


def test_a_viewer_that_comes_back_is_sent_what_is_new(make_run: Callable[..., Path]) -> None:
    folder = make_run()

    async def play(bench: Bench) -> None:
        viewer = await bench.viewer("me")
        first = await heard(viewer, lambda message: message.get("upTo", 0) > 0)
        await viewer.close()
        again = await bench.viewer("me", session=first["session"], entries=first["upTo"])
        second = await heard(again, lambda message: "entries" in message)
        assert second["reset"] is False
        assert {entry[1] for entry in second["entries"]} == {None}

    serve(play, fixed=folder)


def test_several_runs_can_be_watched_at_once(make_run: Callable[..., Path]) -> None:
    make_run("first"), make_run("second")

    async def play(bench: Bench) -> None:
        for name in ("first", "second"):
            viewer = await bench.viewer(name)
            await heard(viewer, lambda message: len(message.get("status", {}).get("runs", [])) == 2)
            await viewer.send(json.dumps({"watch": name}))
            seen = await heard(viewer, lambda message, name=name: message.get("status", {}).get("run") == name)  # type: ignore[misc]
            assert seen["status"]["live"] is False

    serve(play)


# --- commands ------------------------------------------------------------------------------------------------------------


def test_one_commands_the_others_watch(make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> None:
    folder = make_run()
    done: list[str] = []
    monkeypatch.setattr(commands, "is_live", lambda _run: True)
    link = Robot(abort=lambda: done.append("abort") or "the robot stops where it is")

    async def play(bench: Bench) -> None:
        one, two = await bench.viewer("one"), None
        await heard(one, lambda message: message.get("upTo", 0) > 0)
        await heard(one, lambda message: message.get("status", {}).get("commands") is True)
        two = await bench.viewer("two")
        assert await answer_to(two, command="abort", run="run") == "refused: you watch; take over first"
        assert await answer_to(two, command="take") == "you command now"
        assert await answer_to(one, command="abort", run="run") == "refused: you watch; take over first"
        assert done == []
        assert "another one by now" in await answer_to(two, command="abort", run="an older one")
        assert "another one by now" in await answer_to(two, command="abort")
        assert await answer_to(two, command="abort", run="run") == "the robot stops where it is"
        assert done == ["abort"]
        assert await answer_to(two, command="reboot") == "refused: there is no command reboot"

    serve(play, fixed=folder, link=link)
    acts_done = run_log.read(folder, run_log.ACT)
    assert [(act["command"], act["by"]) for act in acts_done] == [("take", "two"), ("abort", "two")]
    assert acts_done[1]["stamp_s"] == pytest.approx(73.0)


def test_an_act_that_waits_keeps_no_other_from_being_done(make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> None:
    folder, landed = make_run(), threading.Event()
    monkeypatch.setattr(commands, "is_live", lambda _run: True)
    link = Robot(pause=lambda: "paused" if landed.wait(WAIT_S) else "nothing came", abort=lambda: landed.set() or "landing")

    async def play(bench: Bench) -> None:
        viewer = await bench.viewer("me")
        await heard(viewer, lambda message: message.get("status", {}).get("commands") is True)
        for command in ("pause", "abort"):
            await viewer.send(json.dumps({"command": command, "run": "run"}))
        answers = {(await heard(viewer, lambda message: "answer" in message))["answer"] for _ in range(2)}
        assert answers == {"paused", "landing"}

    serve(play, fixed=folder, link=link)


def test_pressing_again_asks_for_nothing_new_and_every_press_is_answered(
    make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, go, told = make_run(), threading.Event(), []
    monkeypatch.setattr(commands, "is_live", lambda _run: True)
    link = Robot(abort=lambda: told.append("abort") or ("landing" if go.wait(WAIT_S) else "nothing came"))

    async def play(bench: Bench) -> None:
        viewer = await bench.viewer("me")
        await heard(viewer, lambda message: message.get("status", {}).get("commands") is True)
        for _ in range(3):
            await viewer.send(json.dumps({"command": "abort", "run": "run"}))
        await viewer.send(json.dumps({"command": "abort", "run": "an older one"}))
        await heard(viewer, lambda message: "another one by now" in message.get("answer", ""))
        go.set()
        assert [(await heard(viewer, lambda message: "answer" in message))["answer"] for _ in range(3)] == ["landing"] * 3
        assert told == ["abort"]
        assert await answer_to(viewer, command="abort", run="run") == "landing"
        assert told == ["abort", "abort"]

    serve(play, fixed=folder, link=link)
    assert len(run_log.read(folder, run_log.ACT)) == 2


def test_a_mission_is_connected_to_once_ahead_of_commands_and_left_when_its_run_is_over(
    make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, link, live = make_run(), Robot(abort=lambda: "landing"), [True]
    monkeypatch.setattr(commands, "is_live", lambda _run: live[0])

    async def play(bench: Bench) -> None:
        viewer = await bench.viewer("me")
        until = lambda condition: heard(viewer, lambda message: "status" in message and condition())  # noqa: E731
        await until(lambda: link.domains == [101])
        for _ in range(3):
            assert await answer_to(viewer, command="abort", run="run") == "landing"
        assert (link.domains, link.closed) == ([101], 0)
        live[0] = False
        await until(lambda: link.closed == 1)
        known = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        (folder / "run.json").write_text(json.dumps({**known, "domain": 7, "run_id": "another"}), encoding="utf-8")
        live[0] = True
        await until(lambda: link.domains == [101, 7])

    serve(play, fixed=folder, link=link)
    assert link.closed == 2


def test_runs_of_a_robot_beside_are_shown_in_its_words_and_commanded_each_for_itself(
    make_run: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both runs have one name and are in one domain: what is sent to the one must not reach the other."""
    own, other = make_run("same"), make_run("other")
    (tmp_path / "rover").mkdir()
    (tmp_path / "rover" / "robot.yaml").write_text("name: rover\npage: {stop: stop the rover}\n", encoding="utf-8")
    rover = load_robot_folder(tmp_path / "rover")
    rover.runs.mkdir()
    away = other.rename(rover.runs / "same")
    known = json.loads((away / "run.json").read_text(encoding="utf-8"))
    (away / "run.json").write_text(json.dumps({**known, "namespace": "/rover"}), encoding="utf-8")
    os.utime(away / "run.json", (1.0, 1.0))
    monkeypatch.setattr(commands, "is_live", lambda _run: True)
    told: list[str] = []

    class Both(Robot):
        def connect(self, run: Run) -> Robot:
            name = run.namespace or "own"
            return Robot(abort=lambda: told.append(f"{name} stops") or "stops", pause=lambda: told.append(f"{name} holds") or "holds")

    async def play(bench: Bench) -> None:
        viewer = await bench.viewer("me")
        status = (await heard(viewer, lambda message: len(message.get("status", {}).get("underWay", [])) == 2))["status"]
        assert (status["run"], status["runs"], status["underWay"]) == ("same", ["same", "rover/same"], ["same", "rover/same"])
        assert await answer_to(viewer, command="pause", run="same") == "holds"
        await viewer.send(json.dumps({"watch": "rover/same"}))
        await heard(viewer, lambda message: "stop the rover" in str(message.get("entries")))
        await heard(viewer, lambda message: message.get("status", {}).get("run") == "rover/same")
        assert "another one by now" in await answer_to(viewer, command="abort", run="same")
        assert await answer_to(viewer, command="abort", run="rover/same") == "stops"
        assert told == ["own holds", "/rover stops"]
        assert [[one["command"] for one in run_log.read(run, run_log.ACT)] for run in (own, away)] == [["pause"], ["abort"]]
        (away / "report.html").write_text("the rover's", encoding="utf-8")
        assert await bench.get("/runs/rover%2Fsame/report.html") == (200, "the rover's")
        assert (await bench.get("/runs/same/report.html"))[0] == 404

    serve(play, link=Both(), beside=[rover])


def test_the_runs_of_a_fleets_robots_are_shown_below_that_of_their_mission(
    make_run: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mission, robot = make_run("meet"), make_run("meet/rover")
    for name, text in {"rover": "page: {stop: stop the rover}\n", "fleet": "robots: {rover: ../rover}\n"}.items():
        (tmp_path / name).mkdir()
        (tmp_path / name / "robot.yaml").write_text(f"name: {name}\n{text}", encoding="utf-8")
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path / "fleet"))
    os.utime(mission / "run.json", (1.0, 1.0))
    (robot / "report.html").write_text("the rover's", encoding="utf-8")

    async def play(bench: Bench) -> None:
        viewer = await bench.viewer("me")
        status = (await heard(viewer, lambda message: len(message.get("status", {}).get("runs", [])) == 2))["status"]
        assert (status["run"], status["runs"]) == (mission.name, ["meet", "meet/rover"])
        await viewer.send(json.dumps({"watch": "meet/rover"}))
        await heard(viewer, lambda message: "stop the rover" in str(message.get("entries")))
        assert await bench.get("/runs/meet%2Frover/report.html") == (200, "the rover's")

    serve(play)


@pytest.mark.parametrize(
    ("robots", "complaint"),
    [([None], "robot.yaml: No such file or directory; name the robot's folder"), (["rover", "rover"], "told apart by their names")],
)
def test_robots_beside_have_to_be_robots_with_names_of_their_own(
    robots: list[str | None], complaint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words: list[str] = []
    for number, name in enumerate(robots):
        folder = tmp_path / str(number)
        folder.mkdir()
        if name is not None:
            (folder / "robot.yaml").write_text(f"name: {name}\n", encoding="utf-8")
        words += ["--beside", str(folder)]
    assert main(words) == 2
    said = capsys.readouterr().err
    assert complaint in said
    assert said.count("\n") == 1


def test_a_robot_that_can_not_be_reached_is_told_and_nothing_else_is_held_up(
    make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = make_run()
    monkeypatch.setattr(commands, "is_live", lambda _run: True)

    class Nowhere(Robot):
        def connect(self, run: Run) -> Robot:
            raise ActError("there is no ROS 2 here")

    async def play(bench: Bench) -> None:
        viewer = await bench.viewer("me")
        await heard(viewer, lambda message: "there is no ROS 2 here" in message.get("status", {}).get("problems", []))
        assert await answer_to(viewer, command="abort", run="run") == "refused: there is no ROS 2 here"

    serve(play, fixed=folder, link=Nowhere())


def test_a_run_that_is_over_is_not_commanded(make_run: Callable[..., Path]) -> None:
    folder = make_run()

    async def play(bench: Bench) -> None:
        viewer = await bench.viewer("me")
        await heard(viewer, lambda message: "status" in message)
        for command in ("abort", "off"):
            assert await answer_to(viewer, command=command, run="run") == "refused: this run is over"

    serve(play, fixed=folder)


def test_everything_off_ends_the_processes_of_the_run(make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> None:
    ended: list[tuple[str, float]] = []
    monkeypatch.setattr(acts, "end_run", lambda run_id, *, timeout_s: ended.append((run_id, timeout_s)) or [1, 2, 3])
    folder = make_run()
    assert acts.everything_off(folder) == "3 processes were ended at once"
    assert ended == [("id-run", 0.0)]
    aborts.note_abort(folder, aborts.ReportedAbort(aborts.FRONT, "the supervisor died"))  # which is what the front sees of it
    assert aborts.read_abort(folder) == aborts.ReportedAbort(aborts.OPERATOR, "everything off")


@pytest.mark.parametrize(
    ("asked", "why"),
    [
        ({"scenario": "nowhere"}, "there is no scenario 'nowhere'; there are inspection, mapping"),
        ({"scenario": ["mapping"]}, "there is no scenario"),
        ({"scenario": "mapping", "seed": -1}, "the seed has to be a whole number"),
        ({"scenario": "mapping", "seed": True}, "the seed has to be a whole number"),
        ({"scenario": "mapping", "faults": "zed"}, "faults are a list of at most 8"),
        ({"scenario": "mapping", "faults": ["zed@30"] * 9}, "faults are a list of at most 8"),
        ({"scenario": "mapping", "faults": ["--world=/etc/passwd"]}, "is no fault"),
        ({"scenario": "mapping", "faults": ["zed@soon"]}, "zed@soon"),
        ({"scenario": "mapping", "world": "--help"}, "is no world"),
        ({"scenario": "mapping", "world": "yard\n"}, "is no world"),
        ({"scenario": "mapping", "world": 3}, "is no world"),
        ({"scenario": "mapping", "over": "balloon"}, "a run is live or over mocks, not 'balloon'"),
        ({"scenario": "mapping", "options": ["--rate=0"]}, "options are texts by their names"),
        ({"scenario": "mapping", "options": {"rate": 0}}, "options are texts by their names"),
        ({"scenario": "mapping", "options": {"out": "/etc"}}, "the robot has no option --out; it declares --link, --quick, --record"),
        ({"scenario": "mapping", "options": {"link": "a\nb"}}, "--link: needs a text of one line"),
        ({"scenario": "mapping", "options": {"record": "all"}}, "--record: there is no 'all'; there are functional, sensors"),
    ],
)
def test_a_run_that_can_not_be_is_refused(asked: dict[str, object], why: str) -> None:
    with pytest.raises(ActError, match=why.replace("'", ".")):
        read_wanted(asked, OPTIONS)


def test_a_run_is_the_command_line_that_it_says(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = {"scenario": "mapping", "seed": 3, "faults": ["zed@30"]}
    mocked, elsewhere = read_wanted({**asked, "over": "mocks"}, ()), read_wanted({**asked, "world": "forest"}, OPTIONS)
    options = {"link": "-o /dev/ttyACM0", "quick": "ignored", "record": "sensors"}
    real = read_wanted({"scenario": "mapping", "over": "live", "options": options}, OPTIONS)
    monkeypatch.setenv("ALULA_ROOT", "/alula")
    words = ["/alula/alula", "run", "mapping", "--seed", "3", "--out", "/out", "--fail", "zed@30"]
    assert mocked.words(Path("/out")) == [*words, "--mock"]
    assert elsewhere.words(Path("/out")) == [*words, "--world=forest"]
    own = ["--link=-o /dev/ttyACM0", "--quick", "--record=sensors"]
    assert real.words(Path("/out")) == ["/alula/alula", "run", "mapping", "--seed", "0", "--out", "/out", *own]


def test_a_run_that_does_not_start_says_why(make_run: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = tmp_path / "alula"
    script.write_text("#!/bin/sh\necho looking >&2\necho 'alula run: all DDS domains are taken' >&2\nexit 2\n", encoding="utf-8")
    script.chmod(0o755)
    monkeypatch.setenv("ALULA_ROOT", str(tmp_path))
    with pytest.raises(ActError, match="alula run: all DDS domains are taken"):
        acts.start(WantedRun("mapping", 0, mock=True))


def test_a_run_that_does_not_begin_is_ended_and_told(
    make_run: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = tmp_path / "alula"
    script.write_text(f"#!/bin/sh\necho $$ > {tmp_path}/pid\necho 'building the skillsets'\nexec sleep 600\n", encoding="utf-8")
    script.chmod(0o755)
    monkeypatch.setenv("ALULA_ROOT", str(tmp_path))
    builds = lambda: any("building" in log.read_text() for log in (tmp_path / "runs").glob(".*.log"))  # noqa: E731
    silent = itertools.count(step=50.0)  # the seconds since it has said so, at each look
    clock = SimpleNamespace(monotonic=lambda: next(silent) if builds() else 0.0, sleep=time.sleep)
    monkeypatch.setattr(acts, "time", clock)
    with pytest.raises(ActError, match="had not begun, said nothing for 120 s and was ended; its last words: building the skillsets"):
        acts.start(WantedRun("mapping", 0, mock=True))
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)


def test_a_run_that_builds_for_minutes_and_says_so_is_waited_for(
    make_run: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = tmp_path / "alula"
    steps = "for step in 1 2 3 4; do echo building $step; sleep 0.3; done"
    out = 'while [ "$1" != --out ]; do shift; done'
    script.write_text(f'#!/bin/sh\n{out}\n{steps}\nmkdir -p "$2"\necho > "$2/run.json"\n', encoding="utf-8")
    script.chmod(0o755)
    monkeypatch.setenv("ALULA_ROOT", str(tmp_path))
    steps_s = lambda: 100.0 * sum(log.read_text().count("building") for log in (tmp_path / "runs").glob(".*.log"))  # noqa: E731
    monkeypatch.setattr(acts, "time", SimpleNamespace(monotonic=steps_s, sleep=time.sleep))
    assert (acts.start(WantedRun("mapping", 0, mock=True)) / "run.json").exists()


def test_only_the_link_to_a_robot_needs_ros() -> None:
    names = sorted(path.stem for path in Path(server.__file__).parent.glob("*.py") if path.stem != "__init__")
    script = f"import sys, alula.cli.console, {', '.join(f'alula.console.{name}' for name in names)}; print(*sys.modules)"
    modules = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    assert [name for name in modules if name.split(".")[0] in {"rclpy", "std_srvs", "skillset_interfaces"}] == []


@pytest.mark.parametrize("name", ["scenario", "world", "options", "seed", "faults", "over"])
def test_half_a_character_is_refused_with_one_line_and_the_viewer_stays(
    make_run: Callable[..., Path], capfd: pytest.CaptureFixture[str], name: str
) -> None:
    folder = make_run()

    async def play(bench: Bench) -> None:
        viewer = await bench.viewer("me")
        await heard(viewer, lambda message: message.get("status", {}).get("commands") is True)
        answer = await answer_to(viewer, command="start", **{"scenario": "mapping", name: ["\ud800x"] if name == "faults" else "\ud800x"})
        assert answer == "refused: the text holds '\\ud800', half of a character (a lone surrogate)"
        assert await answer_to(viewer, command="\ud800x") == answer
        assert await answer_to(viewer, command="take") == "you command now"

    serve(play, fixed=folder)
    assert "Traceback" not in capfd.readouterr().err


def test_whatever_an_act_raises_is_told_to_its_viewer(
    make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    folder = make_run()
    monkeypatch.setattr(commands, "is_live", lambda _run: True)

    def broken() -> str:
        raise RuntimeError("the middleware is broken")

    async def play(bench: Bench) -> None:
        viewer = await bench.viewer("me")
        await heard(viewer, lambda message: message.get("status", {}).get("commands") is True)
        assert await answer_to(viewer, command="abort", run="run") == "refused: the middleware is broken"

    serve(play, fixed=folder, link=Robot(abort=broken))
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.parametrize(
    "content", ["root:x:0:0:secret\n", "secret: 1\n", "- secret\n", "{secret\n", "", "\x00secret", "secret: 1\nsecret: 2\n"]
)
def test_a_file_that_is_no_world_is_refused_and_nothing_of_it_is_shown(tmp_path: Path, content: str) -> None:
    file = tmp_path / "file"
    file.write_text(content, encoding="utf-8")
    for world in (file, tmp_path, tmp_path / "nowhere", Path("/dev/zero")):
        with pytest.raises(ActError, match=r"is no world: give one of .*yard") as refused:
            read_wanted({"scenario": "mapping", "world": str(world)}, ())
        assert "secret" not in str(refused.value)


def test_a_file_with_a_route_is_a_world(tmp_path: Path) -> None:
    file = tmp_path / "meadow.yaml"
    file.write_text("route: [[0, 0, 3], [5, 0, 3]]\n", encoding="utf-8")
    assert read_wanted({"scenario": "mapping", "world": str(file)}, ()).world == str(file)


# --- stamps ---------------------------------------------------------------------------------------------------------------


def test_an_act_before_the_mission_clock_is_heard_carries_no_stamp(make_run: Callable[..., Path]) -> None:
    folder = make_run(story=[(0.0, MISSION, {"scenario": "mapping", "outcome": "running"})])

    async def play(bench: Bench) -> None:
        viewer = await bench.viewer("me")
        await heard(viewer, lambda message: any(topic == MISSION for topic, _, _ in message.get("entries", [])))
        await answer_to(viewer, command="take")
        told = await heard(viewer, lambda message: any(topic == OPERATOR for topic, _, _ in message.get("entries", [])))
        assert [t_s for topic, t_s, _ in told["entries"] if topic == OPERATOR] == [None]

    serve(play, fixed=folder)
    assert [sorted(act) for act in run_log.read(folder, run_log.ACT)] == [["answer", "by", "command"]]


# --- admission --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("headers", "why"),
    [
        ({"Host": "evil.example"}, "reached as localhost only"),
        ({"Host": "127.0.0.1.evil.example:80"}, "reached as localhost only"),
        ({"Host": "["}, "reached as localhost only"),
        ({"Origin": "http://evil.example"}, "other sites are refused"),
        ({"Origin": "null"}, "other sites are refused"),
    ],
)
def test_requests_of_other_sites_are_refused(headers: dict[str, str], why: str, make_run: Callable[..., Path]) -> None:
    async def play(bench: Bench) -> None:
        for path in ("/", FEED, "/runs/run/report.html"):
            status, text = await bench.get(path, **headers)
            assert (status, why in text) == (403, True)

    serve(play)


def test_a_socket_of_another_site_or_of_none_is_refused(make_run: Callable[..., Path]) -> None:
    async def play(bench: Bench) -> None:
        for origin in ("http://evil.example", "null", None, f"https://{bench.base}.evil.example"):
            with pytest.raises(InvalidStatus) as refused:
                await connect(f"ws://{bench.base}{FEED}", origin=origin)  # type: ignore[arg-type]
            assert refused.value.response.status_code == 403

    serve(play)


def test_elsewhere_a_token_is_needed(make_run: Callable[..., Path]) -> None:
    async def play(bench: Bench) -> None:
        assert (await bench.get("/"))[0] == 403
        assert (await bench.get("/?token=guess"))[0] == 403
        assert (await bench.get("/?token=%E2%82%AC"))[0] == 403
        for headers in ({}, {"Host": "robot.local:8440"}):
            assert (await bench.get("/", Cookie=f"other=1; {bench.cookie}", **headers))[0] == 200
        for cookie in ("alula_console_1=secret", bench.cookie + "x", ';=;"', bench.cookie.replace("secret", "")):
            assert (await bench.get("/", Cookie=cookie))[0] == 403
        assert (await bench.get("/runs/run/report.html?token=secret"))[0] == 403, "the token is taken from the page's address alone"
        with pytest.raises(InvalidStatus):
            await connect(f"ws://{bench.base}{FEED}", origin=f"http://{bench.base}")  # type: ignore[arg-type]
        await heard(await bench.viewer("me"), lambda message: "status" in message)

    serve(play, token="secret")  # noqa: S106


@pytest.mark.parametrize(
    ("host", "ours"), [("127.0.0.1", True), ("::1", True), ("localhost", True), ("192.168.1.7", False), ("robot", False)]
)
def test_loopback_is_told_from_the_rest(host: str, *, ours: bool) -> None:
    assert is_loopback(host) is ours


def test_runs_are_found_before_the_first_page_is_served(make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> None:
    """Else a viewer were told of the report of a run that the server does not know yet."""
    order: list[str] = []
    for module, name in ((commands, "runs_in"), (server, "serve")):
        real = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *given, _real=real, _name=name, **named: order.append(_name) or _real(*given, **named))

    async def play(bench: Bench) -> None:
        assert (await bench.get("/"))[0] == 200
        assert order[:2] == ["runs_in", "serve"]

    serve(play, fixed=make_run())


def test_only_reports_of_runs_are_served_and_they_can_not_command(make_run: Callable[..., Path]) -> None:
    folder = make_run()
    (folder / "report.html").write_text("the report", encoding="utf-8")

    async def play(bench: Bench) -> None:
        viewer = await bench.viewer("me")
        await heard(viewer, lambda message: message.get("status", {}).get("report") is True)
        assert await bench.get("/runs/run/report.html") == (200, "the report")
        for path in ("/runs/run/run.json", "/runs/../run/report.html", "/runs/%2e%2e/report.html", "/etc/passwd", "/runs/"):
            assert (await bench.get(path))[0] == 404
        policy = await asyncio.to_thread(
            lambda: urllib.request.urlopen(f"http://{bench.base}/runs/run/report.html").headers["Content-Security-Policy"]
        )
        assert policy == "sandbox allow-scripts"

    serve(play, fixed=folder)


# --- floods ------------------------------------------------------------------------------------------------------------------


async def flood(viewer: ClientConnection) -> None:
    for _ in range(20 * MAX_COMMANDS_PER_S):
        await viewer.send(json.dumps({"command": "take"}))
    await heard(viewer, lambda _message: False)


def test_a_flood_of_commands_ends_its_own_connection_only(make_run: Callable[..., Path]) -> None:
    folder = make_run()

    async def play(bench: Bench) -> None:
        good, bad = await bench.viewer("good"), await bench.viewer("bad")
        with pytest.raises(ConnectionClosed) as ended:
            await flood(bad)
        assert ended.value.rcvd is not None
        assert ended.value.rcvd.reason == "too many commands"
        await heard(good, lambda message: message.get("status", {}).get("viewers") == 1)

    serve(play, fixed=folder)


@pytest.mark.parametrize("message", ["", "[]", "{", '"x"', "x" * (MAX_MESSAGE_BYTES + 1), b"\x00\xff"])
def test_messages_that_make_no_sense_end_their_connection_only(message: str | bytes, make_run: Callable[..., Path]) -> None:
    folder = make_run()

    async def play(bench: Bench) -> None:
        good, bad = await bench.viewer("good"), await bench.viewer("bad")
        await bad.send(message)
        with pytest.raises(ConnectionClosed):
            await heard(bad, lambda _message: False)
        await heard(good, lambda message: message.get("status", {}).get("viewers") == 1)

    serve(play, fixed=folder)


def test_a_viewer_that_hangs_is_dropped_and_the_others_go_on(make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "STUCK_S", 0.3)
    blob = os.urandom(1 << 16).hex()  # can't be made smaller by compression
    folder = make_run(story=[(float(number), "/blackboard", {"blob": blob[number:]}) for number in range(200)])
    make_run("small")

    async def play(bench: Bench) -> None:
        reader, writer = await asyncio.open_connection(*bench.base.split(":"), limit=1 << 10)
        key = "AAAAAAAAAAAAAAAAAAAAAA=="
        head = f"GET {FEED} HTTP/1.1\r\nHost: {bench.base}\r\nOrigin: http://{bench.base}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        writer.write(f"{head}Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n".encode())
        await reader.readuntil(b"\r\n\r\n")
        hello = b'{"key": "hung"}'
        writer.write(bytes([0x81, 0x80 | len(hello), 0, 0, 0, 0]) + hello)  # a masked text frame; then nothing is read any more
        await reader.readexactly(1)  # it is a viewer now
        good = await bench.viewer("good", run="small")  # which never has so much to take that it could hang itself
        await answer_to(good, command="take")  # what it hears from now on is how things were later
        await heard(good, lambda message: message.get("status", {}).get("viewers") == 1)
        writer.close()

    serve(play, fixed=folder)


# --- the command line --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["--run", "/nowhere"], "--run /nowhere: is no run's folder"),
        (["--domain", "99"], "--domain 99: no run is under way there"),
        (["--host", "256.0.0.1"], "alula console:"),
    ],
)
def test_what_can_not_be_served_ends_with_2(words: list[str], why: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 2
    assert why in capsys.readouterr().err


def test_a_server_that_ends_waits_for_no_connection_that_asks_for_nothing(
    make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Browsers open connections ahead of need."""
    make_run()
    monkeypatch.setattr(server, "OPEN_S", 100 * WAIT_S)
    opened: list[tuple[asyncio.StreamReader, asyncio.StreamWriter]] = []

    async def play(bench: Bench) -> None:
        host, _, port = bench.base.rpartition(":")
        opened.append(await asyncio.open_connection(host, int(port)))
        assert (await bench.get("/"))[0] == 200  # so the server has taken the connection before this one

    ended = threading.Thread(target=serve, args=(play,), daemon=True)
    ended.start()
    ended.join(WAIT_S)
    assert opened
    assert not ended.is_alive()
