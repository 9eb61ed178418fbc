"""Find and end every process of a run, however it was started and its parents died.

All processes of a run inherit ``ALULA_RUN_ID``; a process is of the run if, and only if, its environment carries that id.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import select
import signal
import subprocess
import time
from collections.abc import Callable

import psutil

RUN_ID_VARIABLE = "ALULA_RUN_ID"
NODE_NAME_VARIABLE = "ALULA_NODE_NAME"
"""Set for nodes of the ROS 2 world, which don't take the name that roslaunch writes on the command line."""
NAMESPACE_VARIABLE = "ALULA_NAMESPACE"
"""Where a run's names in ROS 2 lie, as ``/rover``; empty: nowhere in particular. `skillset_ros1`'s ``in_ros2`` has nodes know it."""
NAME_WORD = "__name:="
PR_SET_PDEATHSIG = 1  # prctl(2)
KILL_S = 5.0
LOOK_S = 0.05


def die_with_parent() -> None:
    """Ask the kernel for SIGTERM when the parent dies; to be run between fork and exec."""
    ctypes.CDLL(None, use_errno=True).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


def ends_within(child: subprocess.Popen[bytes], timeout_s: float) -> bool:
    """Wait for the end of a child; return whether it has ended. ``Popen.wait`` with a timeout looks every few milliseconds."""
    if child.poll() is None:
        end = os.pidfd_open(child.pid)
        try:
            ended = select.poll()
            ended.register(end, select.POLLIN)
            ended.poll(timeout_s * 1000.0)
        finally:
            os.close(end)
    return child.poll() is not None


def processes_of_run(run_id: str) -> list[psutil.Process]:
    """Return all living processes of the run, this one excepted; zombies don't count."""
    found = []
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error, OSError):  # gone meanwhile, or another user's
            if process.pid != os.getpid() and process.environ().get(RUN_ID_VARIABLE) == run_id:
                found.append(process)
    return found


def end_run(run_id: str, *, timeout_s: float = 3.0) -> list[int]:
    """End all processes of the run: SIGTERM and ``timeout_s`` of wall clock, then SIGKILL; 0: SIGKILL at once.

    Returns:
        The ids of those that still ran.
    """
    told = processes_of_run(run_id)
    if timeout_s > 0.0:
        _signal_all(run_id, psutil.Process.terminate, timeout_s)
    _signal_all(run_id, psutil.Process.kill, KILL_S)
    return [process.pid for process in told]


def _signal_all(run_id: str, send: Callable[[psutil.Process], None], wait_s: float) -> None:
    """Signal the run's processes and wait for their ends, also for those of processes born meanwhile.

    Looks again and again, because waiting by psutil would take a child's exit code away from its parent.
    """
    for process in processes_of_run(run_id):
        with contextlib.suppress(psutil.NoSuchProcess):
            send(process)
    end_s = time.monotonic() + wait_s
    while processes_of_run(run_id) and time.monotonic() < end_s:
        time.sleep(LOOK_S)


def node_name(process: psutil.Process) -> str:
    """Return the name that roslaunch gave a process; empty when it gave none, or the process has ended."""
    for word in command_line(process):
        if word.startswith(NAME_WORD):
            return word.removeprefix(NAME_WORD)
    try:
        return str(process.environ().get(NODE_NAME_VARIABLE, ""))
    except psutil.Error:
        return ""


def command_line(process: psutil.Process) -> list[str]:
    """Return a process's words, none when it has ended."""
    try:
        return list(process.cmdline())
    except psutil.Error:
        return []
