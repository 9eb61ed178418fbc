"""A run: the drone's simulator, functional layer, bridge and managers in a graph of their own, and a skill called from outside.

Run: `setup/in_ros2 python examples/r16_run.py`. It takes half a minute.

It prints:

    TERMINATED (AT_ALTITUDE)
    served; takeoff AT_ALTITUDE; landed: True
"""

from __future__ import annotations

import signal
import subprocess
import tempfile
import time
from pathlib import Path

from alula import AlulaError, open_run
from skillset_ros2 import Robot

ALULA = Path(__file__).resolve().parents[1] / "alula"


def domain_of(folder: Path, process: subprocess.Popen[bytes]) -> int:
    """Return the DDS domain that a run has, as soon as it has one."""
    while process.poll() is None:
        try:
            return int(open_run(folder).request["domain"])
        except (AlulaError, KeyError):
            time.sleep(0.2)
    raise SystemExit("the run has ended before it began")


with tempfile.TemporaryDirectory() as place:
    folder = Path(place) / "run"
    words = [ALULA, "run", "standby", "--rate", "0", "--out", folder]
    run = subprocess.Popen(words, cwd=ALULA.parent, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        with Robot.connect("navigation", domain=domain_of(folder, run), timeout_s=90.0) as robot:
            navigation = robot["navigation"]
            for resource, state in (("homepoint_status", "VALID"), ("SDK_authority", "AVAILABLE")):
                getattr(navigation, resource).becomes(state).get(60.0)
            print(navigation.takeoff(height=3.0, speed=1.0).get(60.0))
    finally:
        run.send_signal(signal.SIGINT)  # it lands
        run.wait()
    flown = open_run(folder)
    (takeoff,) = [one for one in flown.record.executions if one.skill == "takeoff"]
    print(f"{flown.outcome.value}; {takeoff.skill} {takeoff.result}; landed: {flown.summary['landed']}")
