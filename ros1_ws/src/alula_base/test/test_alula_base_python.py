"""A robot's own computer often has Noetic: its Python is 3.8 (Debian 11's: 3.9). A real rospy runs the packages under it here."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

rospy = pytest.importorskip("rospy")

import yaml  # noqa: E402
from geometry_msgs.msg import Twist  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402
from std_msgs.msg import Empty, Header, String  # noqa: E402

from alula.generate.scaffold.skeleton import files_of  # noqa: E402
from alula_testing.waits import until  # noqa: E402

NEEDED = ["PyYAML", "rospkg", "defusedxml", "netifaces", "ifaddr", "python-gnupg", "pycryptodome", "catkin_pkg"]
"""What rospy and its messages import, in place of Debian's packages for its own Python."""
PATH = """
import json, runpy, sys
sys.path += sys.argv.pop(1).split(":")  # behind this Python's own packages
"""
REPORT = """
from std_msgs.msg import Header, UInt8MultiArray
from resource_reporter import calls, ledger, reporter
import node_core.ros
calls.publisher.cache_info()
told = calls.plain([Header(seq=1, frame_id="a"), UInt8MultiArray(data=(1, 2))])
json.dump({"version": sys.version_info[:2], "told": told}, sys.stdout)
"""
WATCH = 'runpy.run_path(sys.argv.pop(1), run_name="__main__")'
SCRIPT = Path(__file__).parents[1] / "scripts/dead_man"
SOURCES = ("resource_reporter/src", "alula_base/src", "node_core/src")


@pytest.fixture(scope="module", params=["3.8", "3.9"])
def python(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Return a command that runs a program, which is to be put behind it, under another Python with what ROS needs."""
    found = sorted((Path.home() / ".pyenv/versions").glob(f"{request.param}.*/bin/python{request.param}"))
    if not found:
        pytest.skip(f"there is no python{request.param} on this machine")
    venv = tmp_path_factory.mktemp("python") / "venv"
    subprocess.run([str(found[-1]), "-m", "venv", str(venv)], check=True, env=bare())
    pip = [str(venv / "bin/pip"), "--disable-pip-version-check", "install", "--quiet", *NEEDED]
    subprocess.run(pip, check=True, env=bare(), capture_output=True)
    return [str(venv / "bin/python"), "-c"]


def bare(**more: str) -> dict[str, str]:
    """Return the environment without what is said to this Python."""
    return {**{name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}, **more}


def places() -> str:
    """Return where ROS and the packages are, with nothing of this Python's own."""
    return ":".join(path for path in sys.path if "/devel/" in path or path.endswith(("dist-packages", *SOURCES)))


def test_the_reporter_runs(python: list[str]) -> None:
    done = subprocess.run([*python, PATH + REPORT, places()], capture_output=True, text=True, check=False, env=bare())
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert said["version"][0] == 3
    assert said["version"][1] < 10, "no Python of the robot's own computer"
    assert [said["told"][0]["seq"], said["told"][1]["data"]] == [1, [1, 2]]


def test_the_dead_man_stops_a_robot(python: list[str], ros_master: str, start_node) -> None:
    """A whole node under that Python: parameters, every kind of call made, the heartbeat heard and missed, zero velocity sent."""
    stop = {
        "wheels": {"zero": "/old/cmd_vel", "for_s": 0.1},
        "brake": {"service": "/old/brake", "type": "std_srvs/SetBool", "request": {"data": True}, "within_s": 0.1},
        "navigation": {"cancel": "/old/move", "within_s": 0.1},
        "script": {"script": ["true"]},
    }
    report = {"skillset": "old", "resource": "link", "heard": "UP", "silent": "DOWN"}
    rospy.set_param("/old/alula_base", {"heartbeats": ["/old/alive"], "silent_after_s": 2.0, "stop": stop, "report": report})
    told: list[Twist] = []
    states: list[dict] = []
    subscribers = [
        rospy.Subscriber("/old/cmd_vel", Twist, told.append),
        rospy.Subscriber("/old/alula_base/state", String, lambda message: states.append(json.loads(message.data))),
    ]
    heart = rospy.Publisher("/old/alive", Empty, queue_size=1)
    start_node([*python, PATH + WATCH, places(), str(SCRIPT), "__ns:=/old"])
    until(lambda: states and all(part.get_num_connections() for part in (*subscribers, heart)), what="the node is there")
    heart.publish()
    until(lambda: told, what="it stops the wheels")
    until(lambda: all(call["done"] is not None for call in states[-1]["calls"].values()), what="all calls are made")
    assert {name: call["done"] for name, call in states[-1]["calls"].items()} == {
        "wheels": True,
        "brake": False,
        "navigation": False,
        "script": True,
    }
    assert states[-1]["calls"]["brake"]["said"].startswith("/old/brake: ")
    for part in (*subscribers, heart):
        part.unregister()


def test_the_base_of_a_new_robot_stops_when_the_managers_are_silent(python: list[str], ros_master: str, start_node, tmp_path: Path) -> None:
    """What `alula new robot` makes for the base's computer, which has nothing of the library."""
    files = files_of("cart")
    base = tmp_path / "base"
    base.write_text(files["ros1_ws/src/cart_base/scripts/base"], encoding="utf-8")
    rospy.set_param("/alula_base", yaml.safe_load(files["ros1_ws/src/cart_base/config/dead_man.yaml"]))
    speeds: list[float] = []
    states: list[dict] = []
    subscribers = [
        rospy.Subscriber("/cart/odom", Odometry, lambda message: speeds.append(message.twist.twist.linear.x)),
        rospy.Subscriber("/alula_base/state", String, lambda message: states.append(json.loads(message.data))),
    ]
    heart, commands = rospy.Publisher("/cart/alive", Header, queue_size=1), rospy.Publisher("/cart/cmd_vel", Twist, queue_size=1)
    for script in (base, SCRIPT):
        start_node([*python, PATH + WATCH, places(), str(script)])
    # The base listens to its driver and to the dead man.
    until(lambda: speeds and states and heart.get_num_connections() and commands.get_num_connections(), what="both nodes are there")

    def under_way() -> bool:
        heart.publish(Header())
        twist = Twist()
        twist.linear.x = 0.5
        commands.publish(twist)
        return speeds[-1] == 0.5 and states[-1]["state"] == "heard"

    until(under_way, what="it drives", every_s=0.1)
    until(lambda: speeds[-1] == 0.0, what="it stands")
    until(lambda: states[-1]["calls"]["wheels"]["done"], what="that is told")
    assert states[-1]["state"] == "silent"
    for part in (*subscribers, heart, commands):
        part.unregister()
