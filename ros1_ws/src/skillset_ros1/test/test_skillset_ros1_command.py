"""``python -m skillset_ros1``, with the README's hooks."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest
from skillset_ros1_bench import SOON_S

from skillset_ros1 import SkillsetClient
from skillset_ros1.__main__ import main

HERE = Path(__file__).parent


def test_a_skillset_is_served(ros_master):
    words = ["perception", "--hooks", "skillset_ros1_readme_hooks:make_hooks", "__ns:=/robot1"]
    process = subprocess.Popen([sys.executable, "-m", "skillset_ros1", *words], cwd=HERE)
    client = SkillsetClient("perception", namespace="/robot1")
    try:
        assert client.wait_ready(2 * SOON_S)
        assert client.transition("lidar_status", "OK").get(SOON_S).accepted
        handle = client.start("lidar_depthmap")
        assert handle.wait(SOON_S)
        assert (handle.outcome, handle.result) == ("TERMINATED", client.model.skill("lidar_depthmap").results[0].name)
        process.send_signal(signal.SIGINT)
        assert process.wait(SOON_S) == 0
    finally:
        client.close()
        process.kill()
        process.wait()


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (["wings", "--hooks", "a:b"], "there is no skillset wings: generate and build it first"),
        (["perception", "--hooks", "hooks"], "--hooks hooks: a module and a function are wanted, as my_robot.navigation:make_hooks"),
        (["perception", "--hooks", "nothing.here:f"], "--hooks nothing.here:f: there is no module nothing.here on the PYTHONPATH"),
        (["perception", "--hooks", "json:nothing"], "--hooks json:nothing: json has no function nothing"),
    ],
)
def test_what_is_not_there_is_told(capsys, words, error):
    assert main(words) == 2
    assert capsys.readouterr().err == f"skillset_ros1: {error}\n"
