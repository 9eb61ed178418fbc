"""Is there room for what a deployment records?"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator

from alula.common.deployments import Deployment
from alula.common.files import folder_there
from alula.common.robots import RobotFolder
from alula_flight.doctor.findings import DISK, Finding, ok, problem
from alula_flight.station.disk import FREE_GB, FULL, GB, kept_of
from alula_flight.station.parts import Places


def look_at_disk(deployment: Deployment, places: Places, robot: RobotFolder) -> Iterator[Finding]:
    """Yield what is to be said of the disk; removes nothing."""
    folder = folder_there(robot.runs)
    free_gb = shutil.disk_usage(folder).free / GB
    if not os.access(folder, os.W_OK):
        yield problem(DISK, f"{folder} can't be written", f"chown or chmod {folder}")
    if free_gb < FREE_GB:
        yield problem(DISK, f"{free_gb:.1f} GB are free in {folder}", "make room: a mission's record stops where the disk is full")
    taken_gb = sum(one.size for one in kept_of(robot.runs, places.bags, deployment.name)) / GB
    words = f"missions and recordings take {taken_gb:.1f} of {deployment.disk_gb:g} GB (`record: disk_gb`), {free_gb:.1f} GB are free"
    if taken_gb > FULL * deployment.disk_gb:
        yield problem(DISK, f"{words}: the oldest go next", f"copy what you want to keep, or raise `disk_gb` in {deployment.path}")
    elif free_gb < deployment.disk_gb - taken_gb:
        yield problem(DISK, f"{words}: `disk_gb` is more than there is", f"lower `disk_gb` in {deployment.path}")
    else:
        yield ok(DISK, words)
