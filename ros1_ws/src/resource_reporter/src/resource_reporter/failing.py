"""An error in a thread ends its node, visibly: a node that only looks healthy is worse than one that is started again."""

from __future__ import annotations

import atexit
import functools
import os
import sys
import threading
import traceback
from typing import Any, Callable, TypeVar

import rospy

FAILED = 1
END_LIMIT_S = 10.0
"""The node's own end may take so long (wall clock)."""

JobT = TypeVar("JobT", bound=Callable[..., Any])


def ends_the_node(job: JobT) -> JobT:
    """Make an exception of another thread's job end the process: the error in the log, exit code 1."""

    @functools.wraps(job)
    def run(*arguments: Any, **words: Any) -> Any:
        try:
            return job(*arguments, **words)
        except Exception as error:  # noqa: BLE001 -- of whatever kind, nobody else hears of it
            if not rospy.is_shutdown():  # topics are closed then while threads still use them
                end_node(error)

    return run  # type: ignore[return-value]  # takes what the job takes


def end_node(error: Exception) -> None:
    """Log the error, shut the node down as rospy does, and end the process with exit code 1."""
    where = threading.current_thread().name
    told = "".join(traceback.format_exception(type(error), error, error.__traceback__))
    rospy.logfatal("an error in the thread %s ends this node:\n%s", where, told)
    atexit.register(_leave)  # first of all at exit, where the main thread returns from rospy.spin
    threading.Thread(target=rospy.signal_shutdown, args=(f"an error in the thread {where}",), daemon=True).start()
    late = threading.Timer(END_LIMIT_S, _leave)
    late.daemon = True
    late.start()


def _leave() -> None:
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(FAILED)
