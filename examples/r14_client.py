"""A client in ROS 2: it calls whatever serves the skillset, here its mocks in another process, and knows it by its description.

Run: `setup/in_ros2 python examples/r14_client.py`.

It prints:

    skills: lidar_mapping; resources: height_status AGREED, imu_status OK, mapping_process IDLE, slam_status UNKNOWN
    RUNNING
    a second one: NOT_READY idle
    INTERRUPTED
"""

from __future__ import annotations

import signal
import subprocess
import sys

from skillset_ros2 import Robot

served = subprocess.Popen([sys.executable, "-m", "mapping_managers.mock"], stdout=subprocess.DEVNULL)
try:
    with Robot.connect("mapping", timeout_s=30.0) as robot:  # spins by itself
        mapping, client = robot["mapping"], robot.clients["mapping"]
        states = ", ".join(f"{name} {state}" for name, state in sorted(client.resources.items()))
        print(f"skills: {', '.join(client.skills)}; resources: {states}")
        handle = mapping.lidar_mapping()  # never waits
        for report in handle:  # to its end
            if report.state.name == "RUNNING":
                print("RUNNING")
                second = mapping.lidar_mapping().get(timeout_s=10.0)
                print("a second one:", second.outcome, second.result)
                handle.interrupt()
                break
        print(handle.get(timeout_s=10.0).outcome)
finally:
    served.send_signal(signal.SIGINT)
    served.wait()
