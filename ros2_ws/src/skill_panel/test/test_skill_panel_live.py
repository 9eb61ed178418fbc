"""The panel on its screen, without a terminal, against a real skillset in another process."""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("navigation_interfaces.action")

from textual.widgets import Button, Input, RichLog, Static

from skill_panel.__main__ import main
from skill_panel.app import Panel
from skill_panel.memory import Memory
from skill_panel.watcher import Watcher, wait_for
from skill_panel.widgets import ResourceLine, SkillForm, SkillTable

SOON_S = 15.0
READY_S = 30.0
SIZE = (130, 42)


@pytest.fixture
def skillset(ros2_domain):
    program = str(Path(__file__).with_name("skill_panel_process.py"))
    command = [sys.executable, program, "--ros-args", "-r", "navigation:__ns:=/panel_test"]
    served = subprocess.Popen(command, start_new_session=True)
    yield served
    if served.poll() is None:
        served.terminate()
    served.wait(10.0)


@pytest.fixture
def watcher(ros2_domain):
    made = Watcher(domain=ros2_domain, namespace="/panel_test")
    yield made
    made.close()


class Screen:
    """What a test sees and does."""

    def __init__(self, app: Panel, pilot) -> None:
        self.app, self.pilot = app, pilot

    async def until(self, condition, what: str, timeout_s: float = SOON_S) -> None:
        end = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < end, f"not within {timeout_s} s: {what}; log: {self.log}"
            await self.pilot.pause(0.02)

    @property
    def log(self) -> str:
        return "\n".join(line.text for line in self.app.query_one("#log", RichLog).lines)

    @property
    def needs(self) -> str:
        return str(self.app.query_one("#needs", Static).content)

    def cell(self, skill: str, column: str) -> str:
        return str(self.app.query_one(SkillTable).get_cell(skill, column))

    def line(self, resource: str) -> ResourceLine:
        return next(line for line in self.app.query(ResourceLine) if line.row.name == resource)

    async def go_to_table(self) -> None:
        """Leave the input; the focus follows some turns of the event loop later."""
        await self.pilot.press("escape")
        await self.until(lambda: self.app.query_one(SkillTable).has_focus, "the table has the focus")

    async def press_transition(self, resource: str, to: str) -> None:
        """Take an extern transition by its button, once that is there."""

        def button() -> Button | None:
            return next((one for one in self.line(resource).query(Button) if one.name == to and one.display), None)

        await self.until(lambda: button() is not None, f"{resource} has a button for {to}")
        button().focus()
        await self.until(lambda: button().has_focus, f"the button for {to} has the focus")
        await self.pilot.press("enter")
        await self.until(lambda: self.line(resource).row.state == to, f"{resource} is {to}")


def test_a_skillset_is_driven_by_keyboard(skillset, watcher, tmp_path):
    memory = Memory(tmp_path / "panel.json")

    async def drive() -> None:
        app = Panel(watcher, where="in a test", memory=memory)
        async with app.run_test(size=SIZE) as pilot:
            screen = Screen(app, pilot)
            await screen.until(lambda: app.query_one(SkillTable).row_count == 7, "the skills are shown", READY_S)
            await screen.until(lambda: app.query_one(SkillForm).skill == "takeoff", "the first skill's form is shown")
            await why_not_is_live(screen)
            await start_pause_interrupt(screen)
            await refusals_are_shown(screen)
            await managers_may_go(screen, skillset)

    asyncio.run(drive())
    assert Memory(tmp_path / "panel.json").texts("navigation", "takeoff") == {"height": "300", "speed": "1.5"}


async def why_not_is_live(screen: Screen) -> None:
    await screen.until(lambda: "sdk_authority: SDK_authority is UNAVAILABLE" in screen.needs, "why not is said")
    assert "home_valid" in screen.needs
    await screen.press_transition("SDK_authority", "AVAILABLE")
    await screen.until(lambda: "sdk_authority" not in screen.needs, "why not follows")
    await screen.press_transition("homepoint_status", "VALID")
    await screen.until(lambda: screen.needs == "could start now", "nothing is missing")
    await screen.until(lambda: screen.cell("takeoff", "state") == "ready", "the table says so, too")


async def start_pause_interrupt(screen: Screen) -> None:
    pilot = screen.pilot
    await screen.go_to_table()
    await pilot.press("enter")  # from the table to the first input
    height, speed = screen.app.query_one(SkillForm).query(Input)
    await screen.until(lambda: height.has_focus, "the first input has the focus")
    height.value = "high"
    speed.value = "1.5"
    await pilot.press("f5")
    await screen.until(lambda: "height: 'high' is no number" in str(screen.app.query_one("#complaint", Static).content), "a complaint")
    height.value = "5"
    await pilot.press("enter", "enter")  # the next input, then the start
    await screen.until(lambda: screen.cell("takeoff", "state") == "RUNNING", "it runs")
    await screen.until(lambda: "25%" in screen.cell("takeoff", "progress"), "progress is shown")
    await screen.until(lambda: screen.line("axes_authority").row.state == "USED", "the resource follows")
    await pilot.press("f7")
    await screen.until(lambda: screen.cell("takeoff", "state") == "PAUSED", "it is paused")
    await pilot.press("f7")
    await screen.until(lambda: screen.cell("takeoff", "state") == "RUNNING", "it is resumed")
    await pilot.press("f6")
    await screen.until(lambda: screen.cell("takeoff", "last end") == "INTERRUPTED", "it is interrupted")
    await screen.until(lambda: "axes_authority USED -> AVAILABLE by takeoff" in screen.log, "the log tells")


async def refusals_are_shown(screen: Screen) -> None:
    screen.app.query_one(SkillForm).query(Input).first().value = "300"
    await screen.pilot.press("f5")
    await screen.until(lambda: screen.cell("takeoff", "last end") == "NOT_VALIDATED", "the hook refuses")
    await screen.until(lambda: "too high" in screen.log, "and says why")
    await screen.go_to_table()
    await screen.pilot.press(*["down"] * 6)
    await screen.until(lambda: screen.app.query_one(SkillForm).skill == "land", "the form follows the cursor")
    await screen.pilot.press("enter")  # no inputs: starts at once
    await screen.until(lambda: screen.cell("land", "last end") == "NOT_READY in_air", "the managers refuse")
    await screen.pilot.press("f8")
    await screen.until(lambda: "why land: in_air: flight_status is ON_GROUND" in screen.log, "the managers explain")
    await screen.until(lambda: "SDK_authority UNAVAILABLE -> AVAILABLE by extern" in screen.log.split("why land")[1], "with the history")


async def managers_may_go(screen: Screen, served) -> None:
    served.kill()
    await screen.until(lambda: "the managers have gone" in screen.log, "the panel notices")
    await screen.until(lambda: "the managers have gone" in screen.needs, "nothing can start")
    await screen.pilot.press("f5")
    await screen.until(lambda: "the managers of navigation are not there" in screen.log, "and says so when asked to")


def test_no_skillset_is_there(watcher):
    async def drive() -> None:
        app = Panel(watcher, where="in DDS domain 7", others=["A run is under way: ./alula panel --run here"])
        async with app.run_test(size=SIZE) as pilot:
            await pilot.pause()
            said = str(app.query_one("#no-skillset", Static).content)
            assert "No skillset is running in DDS domain 7." in said
            assert "./alula fly mapping" in said
            assert "A run is under way: ./alula panel --run here" in said
            assert not app.query_one("#middle").display
            await pilot.press("f5", "f6", "f7", "f8", "r", "i", "right_square_bracket", "escape", "q")

    asyncio.run(drive())


def test_wrong_input_is_one_line_and_exit_code_2(tmp_path, capsys):
    assert main(["--run", str(tmp_path)]) == 2
    assert f"alula panel: {tmp_path} is no run's folder" in capsys.readouterr().err
    with pytest.raises(SystemExit) as ended:
        main(["--domain", "999"])
    assert ended.value.code == 2
    assert "a number from 0 to 232" in capsys.readouterr().err


def test_the_list_says_what_runs(skillset, ros2_domain, tmp_path):
    # No run of the checkout is listed, whichever domain it had.
    (tmp_path / "robot.yaml").write_text("name: rover\n")
    environment = {**os.environ, "ROS_DOMAIN_ID": str(ros2_domain), "ALULA_ROBOT": str(tmp_path)}
    end = time.monotonic() + READY_S
    said = ""
    while "/panel_test/navigation" not in said:
        assert time.monotonic() < end, said
        command = [sys.executable, "-m", "skill_panel", "--list", "--namespace", "/panel_test"]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)
        assert done.returncode == 0, done.stderr
        said = done.stdout
    assert said.startswith(f"in DDS domain {ros2_domain}: /panel_test/navigation\n")


def test_a_skillset_of_another_robot_whose_actions_are_others_is_told_and_not_shown(skillset, ros2_domain, monkeypatch):
    import mapping_interfaces.action

    from skill_panel.watcher import Watcher

    monkeypatch.setattr("skill_panel.watcher.action_module", lambda _name: mapping_interfaces.action)
    watcher = Watcher(domain=ros2_domain, namespace="/panel_test")
    try:
        assert wait_for(lambda: bool(watcher.problems), READY_S)
        assert watcher.watched == []
        assert watcher.problems == [
            "/panel_test/navigation is there, but the interfaces of navigation that are built here are another robot's"
        ]
    finally:
        watcher.close()


@pytest.mark.parametrize("topic", ["/clock", "/panel_test/clock"])
def test_the_mission_clock_is_followed_also_when_it_is_heard_late(skillset, watcher, topic):
    """It is that of the robot's namespace, or one that robots share."""
    from rosgraph_msgs.msg import Clock

    from skillset_ros2.session import Session

    assert wait_for(lambda: bool(watcher.watched), READY_S)
    assert watcher.now_ns > 1_000_000_000_000_000_000, "no clock was published yet"
    session = Session("clock_test", domain=watcher.domain)
    try:
        clock = session.node.create_publisher(Clock, topic, 10)
        message = Clock()
        message.clock.sec = 42

        def follows() -> bool:
            clock.publish(message)
            return watcher.now_ns == 42_000_000_000

        assert wait_for(follows, READY_S)
    finally:
        session.close()
