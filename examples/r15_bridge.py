"""The bridge: a topic of ROS 1 arrives in ROS 2, without code for its type. Run: `setup/in_ros2 python examples/r15_bridge.py`.

It prints:

    from ROS 1: hello
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

import rclpy
from std_msgs.msg import String

IN_ROS1 = str(Path(__file__).resolve().parents[1] / "setup/in_ros1")
ROUTES = "topics:\n  - {name: /greeting, direction: ros1_to_ros2, type: std_msgs/String, depth: 1}\n"
PUBLISH = ["rostopic", "pub", "-r", "5", "/greeting", "std_msgs/String", "data: hello"]

with socket.socket() as free:
    free.bind(("127.0.0.1", 0))
    port = free.getsockname()[1]
ros1 = {**os.environ, "ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1"}
with tempfile.TemporaryDirectory() as folder:
    (Path(folder) / "bridge.yaml").write_text(ROUTES, encoding="utf-8")
    commands = [
        [IN_ROS1, "rosmaster", "--core", "-p", str(port)],
        [sys.executable, "-m", "ros_bridge", "--config", f"{folder}/bridge.yaml"],  # waits for the master
        [IN_ROS1, "sh", "-c", 'until rosnode list >&2; do sleep 0.2; done; exec "$@"', "sh", *PUBLISH],
    ]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    processes = [subprocess.Popen(command, env=ros1, start_new_session=True, **quiet) for command in commands]
    try:
        rclpy.init()
        node = rclpy.create_node("listener")
        heard = rclpy.task.Future()
        node.create_subscription(String, "/greeting", heard.set_result, 1)
        rclpy.spin_until_future_complete(node, heard, timeout_sec=60.0)
        print("from ROS 1:", heard.result().data)
    finally:
        rclpy.try_shutdown()
        for process in reversed(processes):
            os.killpg(process.pid, signal.SIGTERM)
            process.wait()
