"""A user's script over the typed client: mypy --strict finds nothing in it, and finds what is wrong in a wrong one."""

from __future__ import annotations

import itertools
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("uav_client")

from skillset_ros2_client_rig import READY_S, Managers, until

from alula.language import reserved_names
from alula.runtime.views import TypedSkillset
from skillset_ros2.robot import RobotClient

SCRIPT = Path(__file__).with_name("skillset_ros2_user_script.py")
SETTINGS = """[mypy]
strict = true
follow_imports_for_stubs = true
[mypy-rclpy.*,geometry_msgs.*,std_msgs.*,uav_msgs.*,skillset_interfaces.*,*_interfaces.*,yaml.*,unique_identifier_msgs.*,action_msgs.*]
ignore_missing_imports = true
follow_imports = skip
disallow_subclassing_any = false
"""
WRONG = """from uav_client import Uav

def fly(uav: Uav) -> None:
    uav.navigation.takeoff(height="high", speed=1.0)
    uav.navigation.takeoff(height=1.0)
    uav.navigation.fly()
    uav.navigation.takeoff(height=1.0, speed=1.0).get(1.0).expect("ARRIVED")
    uav.navigation.flight_status.becomes("FLYING")
"""


def test_a_users_script_is_checked_by_types(tmp_path):
    mypy = shutil.which("mypy")
    if mypy is None:
        pytest.skip("mypy is not installed here")
    (tmp_path / "mypy.ini").write_text(SETTINGS)
    (tmp_path / "wrong.py").write_text(WRONG)
    wanted = ("uav_client", "_managers", "/lib", "/skillset_ros2")
    paths = [path for path in sys.path if path.endswith(wanted) and Path(path).is_dir()]
    environment = {**os.environ, "MYPYPATH": os.pathsep.join(paths)}
    command = [
        mypy,
        "--config-file",
        str(tmp_path / "mypy.ini"),
        "--cache-dir",
        str(tmp_path / "cache"),
        str(SCRIPT),
        str(tmp_path / "wrong.py"),
    ]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=250, check=False)
    errors = [line.split("wrong.py:")[-1] for line in done.stdout.splitlines() if "error:" in line]
    assert [int(error.split(":")[0]) for error in errors] == [4, 5, 6, 7, 8], done.stdout + done.stderr


def test_a_users_script_runs(ros2_domain):
    managers = Managers()
    script = subprocess.Popen([sys.executable, str(SCRIPT)], stdout=subprocess.PIPE, text=True)
    try:
        until(lambda: managers.engine.executions or script.poll() is not None, "the script takes off", READY_S)
        execution = managers.running()
        # A script that is slower than the managers would hear of the end only.
        first = script.stdout.readline()
        managers.bring({"flight_status": "IN_AIR", "link": "UP"})
        execution.terminate("AT_ALTITUDE")
        managers.hooks["goto"].dispatched.wait(READY_S)
        # What lands before the script watches is no change that it could see.
        climbed = list(itertools.takewhile(lambda line: line != "on the way\n", script.stdout))
        managers.bring({"flight_status": "ON_GROUND"})
        ended = script.stdout.read().splitlines()
        script.wait(READY_S)
    finally:
        if script.poll() is None:
            script.kill()
            script.wait()
        managers.close()
    assert script.returncode == 0
    assert first.split()[0] in {"REQUESTED", "RUNNING"}
    assert climbed[-1] == "AT_ALTITUDE\n"
    assert ended == ["INTERRUPTED", "in_air: flight_status is ON_GROUND"]


def test_the_generator_knows_the_attributes_of_the_classes_that_it_derives_from():
    assert {name for name in dir(RobotClient(None, [])) if not name.startswith("_")} | {"connect"} == reserved_names.ROBOT
    assert {name for name in dir(TypedSkillset(None)) if not name.startswith("_")} | {"data"} == reserved_names.CLIENT
