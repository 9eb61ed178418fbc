"""A ROS 1 node in a process of its own, for tests: takes commands as JSON lines, reports events as JSON lines, ends with its input."""

import json
import os
import sys
import threading

import rospy

WRITE = threading.Lock()


def report(**event):
    with WRITE:
        sys.stdout.write(json.dumps(event) + "\n")
        sys.stdout.flush()


def run(name, commands):
    """Be a node, and do what the lines say."""
    rospy.init_node(name, anonymous=True, disable_signals=True, disable_rostime=True)
    report(event="ready")
    for line in sys.stdin:
        command = json.loads(line)
        commands[command.pop("do")](**command)
    os._exit(0)
