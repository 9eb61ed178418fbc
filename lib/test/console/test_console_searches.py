"""What could have been done about a fault: searched for by a process that viewers follow, stop and get the answer of."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from console_page import DRAWN, Page
from console_reports import make_report
from console_serving import Bench, answer_to, heard, serve, served

pytest.importorskip("z3")
pytest.importorskip("py_trees")

from alula.common.runs import Run
from repair_bench.cases import FAULT, growing

Make = Callable[..., Path]


def run_of(make_run: Make, family: str, size: int) -> Path:
    """Return the folder of a run of a robot that grows."""
    folder = make_run()
    robot = folder.parent.parent / "robot"
    growing(family, size, robot)
    (robot / "scenarios").mkdir()
    (robot / "scenarios/main.yaml").write_text("about: drives\nmission: missions/main.xml\nskillsets: [eyes, body]\n")
    (folder / "run.json").write_text(json.dumps({"scenario": "main", "robot": str(robot), "domain": 101, "run_id": "one"}))
    return folder


def found_in(message: dict[str, Any], fault: str = FAULT) -> dict[str, Any]:
    found = message.get("searches", {}).get("found", {}).get(fault, {})
    assert isinstance(found, dict)
    return found


def test_viewers_are_told_of_a_search_and_its_answer(make_run: Make) -> None:
    folder = run_of(make_run, "legs", 1)

    async def play(bench: Bench) -> None:
        commander, other = await bench.viewer("one"), await bench.viewer("two")
        asked = {"command": "search", "run": folder.name, "fault": FAULT}
        assert await answer_to(commander, **asked) == f"what could have been done about {FAULT} is being looked for"
        assert "a search goes on" in await answer_to(commander, **asked)
        for viewer in (commander, other):
            answer = (await heard(viewer, lambda message: bool(found_in(message).get("answer"))))["searches"]["found"][FAULT]["answer"]
            assert answer.startswith("repaired, proved by check: eyes.watch_0 ('look ahead') fails by the fault blind")
            assert "<eyes.watch_1 " in answer

    serve(play, fixed=folder)


def test_a_search_is_stopped_with_what_it_has(make_run: Make) -> None:
    folder = run_of(make_run, "sensors", 8)

    async def play(bench: Bench) -> None:
        viewer = await bench.viewer("one")
        asked = {"run": folder.name, "fault": FAULT}
        assert "no search goes on" in await answer_to(viewer, command="stop search", **asked)
        await answer_to(viewer, command="search", **asked)
        await heard(viewer, lambda message: "may not be accomplished" in found_in(message).get("says", ""))
        assert await answer_to(viewer, command="stop search", **asked) == "it ends with what it has"
        told = await heard(viewer, lambda message: bool(found_in(message).get("answer")))
        assert found_in(told)["answer"].startswith("unknown: no branch was proved before the search was ended")

    serve(play, fixed=folder)


def test_a_search_ends_with_the_console(make_run: Make) -> None:
    folder = run_of(make_run, "sensors", 8)

    async def play(bench: Bench) -> None:
        viewer = await bench.viewer("one")
        await answer_to(viewer, command="search", run=folder.name, fault=FAULT)
        await heard(viewer, lambda message: bool(found_in(message).get("says")))
        assert searching(folder.parent.parent)

    serve(play, fixed=folder)
    assert searching(folder.parent.parent) == []


def searching(folder: Path) -> list[int]:
    """Return the processes whose command line names a folder."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            words = (process / "cmdline").read_bytes()
        except OSError:
            continue
        if str(folder).encode() in words and b"repair" in words and int(process.name) != os.getpid():
            found.append(int(process.name))
    return found


@pytest.mark.parametrize(
    ("asked", "why"),
    [
        ({"fault": "--out=x"}, "'--out=x' is no fault"),
        ({"fault": ["blind"]}, "['blind'] is no fault"),
        ({"run": "other"}, "the run that is shown is another one by now"),
    ],
)
def test_what_can_not_be_searched_for_is_refused(make_run: Make, asked: dict[str, object], why: str) -> None:
    folder = run_of(make_run, "legs", 1)

    async def play(bench: Bench) -> None:
        viewer = await bench.viewer("one")
        assert why in await answer_to(viewer, **{"command": "search", "run": folder.name, "fault": FAULT, **asked})

    serve(play, fixed=folder)
    assert searching(folder.parent.parent) == []


def test_a_fault_that_the_robot_has_not_is_answered_so(make_run: Make) -> None:
    folder = run_of(make_run, "legs", 1)

    async def play(bench: Bench) -> None:
        viewer = await bench.viewer("one")
        await answer_to(viewer, command="search", run=folder.name, fault="deaf")
        told = await heard(viewer, lambda message: bool(found_in(message, "deaf").get("answer")))
        assert "--fault deaf: there is no such fault" in found_in(told, "deaf")["answer"]

    serve(play, fixed=folder)


def test_beside_a_mission_under_way_it_is_searched_for_only_if_asked(make_run: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = run_of(make_run, "legs", 1)
    monkeypatch.setattr("alula.console.commands.live_runs", lambda: [Run(folder, 101)])

    async def play(bench: Bench) -> None:
        viewer = await bench.viewer("one")
        asked = {"command": "search", "run": folder.name, "fault": FAULT}
        assert "a mission under way on this computer would miss the processor" in await answer_to(viewer, **asked)
        await answer_to(viewer, **asked, beside=True)
        await heard(viewer, lambda message: bool(found_in(message).get("answer")))

    serve(play, fixed=folder)


def test_the_report_has_the_command(browser: Any, tmp_path: Path) -> None:
    page = Page(browser, make_report(tmp_path))
    page.wait(DRAWN)
    assert page.text("#answers tbody code").strip() == "alula repair missions/mapping.xml --fault zed"
    assert page.run("document.querySelector('#answers .search') === null"), "a report can't search"
    assert page.complaints() == []


def test_the_page_asks_and_shows_the_answer(browser: Any, make_run: Make) -> None:
    folder = make_run()
    with served(folder) as console:
        page = Page(browser, console.address)
        page.wait("document.querySelector('#answers .search') !== null && alula.live.state === 'over'")
        for _ in range(2):
            page.run("document.querySelector('#answers .search').click()")
        page.wait("document.querySelector('#repairs pre') !== null")
        said = "nothing to repair: perception.zed_depthmap ('watch with the ZED') fails by the fault zed, and the mission survives it"
        assert page.text("#repairs pre") == page.text("#answers td .hint") == said
        assert page.complaints() == []
