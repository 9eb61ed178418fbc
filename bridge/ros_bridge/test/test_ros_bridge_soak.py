"""The soak script in short: steady topics and calls amid coming and going and restarts of the master."""

import json
import os
import subprocess
import sys


def test_short_soak_loses_nothing_and_grows_nothing(ros2_domain):
    command = [sys.executable, "-m", "bridge_tools.soak", "--minutes", "0.15"]
    done = subprocess.run(command, env=os.environ, capture_output=True, text=True, timeout=200, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    figures = json.loads(done.stdout.splitlines()[-1])
    assert figures["up"]["lost"] == figures["down"]["lost"] == 0
    assert figures["failures"] == []
    assert figures["master_restarts"] >= 1
    assert figures["comings_and_goings"] > 5
    assert figures["grown_mb"] < 10.0
