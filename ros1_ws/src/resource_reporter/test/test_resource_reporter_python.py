"""A robot's own computer often has Noetic: its Python is 3.8, under which a real rospy imports the package and uses it here."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

OLDEST = "3.8"
NEEDED = ["PyYAML", "rospkg", "defusedxml", "netifaces", "ifaddr", "python-gnupg", "pycryptodome", "catkin_pkg"]
"""What rospy and its messages import, in place of Debian's packages for its own Python."""
PROGRAM = """
import json, sys
sys.path += sys.argv[1].split(":")  # behind this Python's own packages
from std_msgs.msg import Header, UInt8MultiArray
from resource_reporter import calls, ledger, reporter
calls.publisher.cache_info()
told = calls.plain([Header(seq=1, frame_id="a"), UInt8MultiArray(data=(1, 2))])
json.dump({"version": sys.version_info[:2], "told": told}, sys.stdout)
"""


def test_it_runs_under_noetics_python(tmp_path: Path) -> None:
    found = sorted((Path.home() / ".pyenv/versions").glob(f"{OLDEST}.*/bin/python{OLDEST}"))
    if not found:
        pytest.skip(f"there is no python{OLDEST} on this machine")
    bare = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    subprocess.run([str(found[-1]), "-m", "venv", str(tmp_path / "venv")], check=True, env=bare)
    pip = [str(tmp_path / "venv/bin/pip"), "--disable-pip-version-check", "install", "--quiet", *NEEDED]
    subprocess.run(pip, check=True, env=bare, capture_output=True)
    here = ":".join(path for path in sys.path if "/devel/" in path or path.endswith(("dist-packages", "resource_reporter/src")))
    done = subprocess.run([str(tmp_path / "venv/bin/python"), "-c", PROGRAM, here], capture_output=True, text=True, check=False, env=bare)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith('{"version": [3, 8], "told": [{"seq": 1, ')
    assert done.stdout.endswith('"data": [1, 2]}]}')
