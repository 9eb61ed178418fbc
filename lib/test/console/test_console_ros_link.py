"""The link to a mission over ROS 2: a real mission's services, in processes that come, are killed, and come again."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("skill_panel", reason="needs ROS 2")

pytest.importorskip("rclpy")

from console_serving import WAIT_S

from alula.common.network import claim_domain
from alula.common.runs import Run
from alula.console.link import ActError
from skill_panel import ros_link
from skill_panel.ros_link import RosLink, RosMission


@contextlib.contextmanager
def mission(domain: int, folder: Path, namespace: str = "/") -> Iterator[None]:
    """Run a mission that does not end by itself."""
    folder.mkdir()
    words = [sys.executable, "-m", "console_bench", str(folder), "--ros-args", "-r", f"__ns:={namespace}"]
    with subprocess.Popen(words, env={**os.environ, "ROS_DOMAIN_ID": str(domain)}) as process:
        try:
            yield
        finally:
            process.kill()


def test_one_connection_serves_a_mission_that_ends_and_comes_again(
    ros2_domain: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ros_link, "ANSWER_S", WAIT_S)
    robot = RosLink().connect(Run(Path(), ros2_domain))
    try:
        for name in ("first", "second"):
            with mission(ros2_domain, tmp_path / name):
                assert "paused" in paused(robot)
                assert "paused" in robot.set_paused(paused=True)
                assert robot.set_paused(paused=False) == "the mission goes on"
                with pytest.raises(ActError, match="the mission is not paused"):
                    robot.set_paused(paused=False)
                assert robot.abort() == "the robot stops where it is"
    finally:
        robot.close()


def paused(robot: RosMission) -> str:
    """Return the answer to a pause as soon as the mission has begun."""
    for _ in range(600):
        with contextlib.suppress(ActError):
            return robot.set_paused(paused=True)
        threading.Event().wait(0.1)
    raise AssertionError("it never began")


def test_missions_in_two_domains_are_told_apart(ros2_domain: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ros_link, "ANSWER_S", WAIT_S)
    claim = claim_domain()
    here, there = RosLink().connect(Run(Path(), ros2_domain)), RosLink().connect(Run(Path(), claim.domain))
    try:
        with mission(claim.domain, tmp_path / "there"):
            assert "paused" in paused(there)
            monkeypatch.setattr(ros_link, "ANSWER_S", 0.2)
            with pytest.raises(ActError, match="the mission did not get the command"):
                here.abort()
    finally:
        here.close()
        there.close()
        claim.release()


def test_missions_in_two_namespaces_of_a_domain_are_commanded_each_for_itself(
    ros2_domain: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ros_link, "ANSWER_S", WAIT_S)
    drone, rover = (RosLink().connect(Run(Path(), ros2_domain, namespace=space)) for space in ("/drone", "/rover"))
    try:
        with mission(ros2_domain, tmp_path / "drone", "/drone"), mission(ros2_domain, tmp_path / "rover", "/rover"):
            assert "paused" in paused(rover)
            assert "paused" in paused(drone)
            assert rover.set_paused(paused=False) == "the mission goes on"
            with pytest.raises(ActError, match="the mission is not paused"):
                rover.set_paused(paused=False)
            assert drone.set_paused(paused=False) == "the mission goes on"
            assert drone.abort() == "the robot stops where it is"
            assert "paused" in paused(rover)
    finally:
        drone.close()
        rover.close()


def test_a_mission_that_is_not_there_is_told_so_and_the_pilot_is_named_not_the_button_that_drops_a_vehicle(
    ros2_domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ros_link, "ANSWER_S", 0.2)
    robot = RosLink().connect(Run(Path(), ros2_domain))
    try:
        with pytest.raises(ActError) as refused:
            robot.abort()
    finally:
        robot.close()
    assert "take it over by hand" in str(refused.value)
    assert "off" not in str(refused.value)


def test_a_mission_that_hangs_is_told_so_and_closing_ends_calls_that_wait(ros2_domain: int, monkeypatch: pytest.MonkeyPatch) -> None:
    from rclpy.executors import SingleThreadedExecutor
    from std_srvs.srv import Trigger

    from skillset_ros2.session import Session

    class Hung(SingleThreadedExecutor):  # type: ignore[misc]  # rclpy is not typed
        def spin(self) -> None:
            """Serve nothing."""

    deaf = Session("deaf", domain=ros2_domain, executor=Hung)
    deaf.node.create_service(Trigger, "/mission/abort", lambda _request, response: response)
    robot = RosLink().connect(Run(Path(), ros2_domain))
    try:
        monkeypatch.setattr(ros_link, "ANSWER_S", 5.0)
        with pytest.raises(ActError, match="got the command and has not answered for 5 s, it may still obey"):
            robot.abort()
        monkeypatch.setattr(ros_link, "ANSWER_S", 10 * WAIT_S)
        told: list[str] = []
        waiting = threading.Thread(target=lambda: told.append(refusal(robot)))
        waiting.start()
        robot.close()
        waiting.join(WAIT_S)
        assert not waiting.is_alive()
        assert "the mission got" in told[0]
    finally:
        robot.close()
        deaf.close()


def refusal(robot: RosMission) -> str:
    with pytest.raises(ActError) as refused:
        robot.abort()
    return str(refused.value)
