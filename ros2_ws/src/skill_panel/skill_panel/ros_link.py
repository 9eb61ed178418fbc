"""The page's link to running robots over ROS 2: what ``alula.console.link`` asks for."""

from __future__ import annotations

import threading
import time
from typing import Any

from std_srvs.srv import SetBool, Trigger

from alula.common.runs import Run
from alula.console.link import ActError, Mission, Skillsets
from skill_panel.watcher import Watcher
from skillset_ros2.session import Session

ANSWER_S = 20.0
"""How long (wall clock) a mission may take to be found and to answer; a machine at its limit took 10 s."""
AGAIN_S = 3.0
LOOK_S = 0.05
LEFT = "press again; where the robot does not obey, take it over by hand"


class RosLink:
    """Reaches robots by the DDS domains and namespaces of their runs."""

    def connect(self, run: Run) -> Mission:
        """Return the mission of a run."""
        return RosMission(run)

    def listen(self, run: Run) -> Skillsets:
        """Return the skillsets of a run."""
        return Watcher(domain=run.domain, namespace=run.namespace)


class RosMission:
    """The services of ``/mission``, found ahead of need: DDS takes a second and more to find them, an answer some milliseconds."""

    def __init__(self, run: Run) -> None:
        self._session = Session("console", domain=run.domain)
        self._abort = self._session.node.create_client(Trigger, f"{run.namespace}/mission/abort")
        self._pause = self._session.node.create_client(SetBool, f"{run.namespace}/mission/pause")
        self._over = threading.Event()
        self._awaited: set[threading.Event] = set()

    def close(self) -> None:
        """End the ROS session; calls under way fail at once."""
        self._over.set()
        for news in tuple(self._awaited):
            news.set()
        self._session.close()

    def abort(self) -> str:
        """Have the mission stop; return what it answers."""
        return str(self._ask(self._abort, Trigger.Request()).message)

    def set_paused(self, *, paused: bool) -> str:
        """Have the mission hold, or go on; return what it answers."""
        answer = self._ask(self._pause, SetBool.Request(data=paused))
        if not answer.success:
            raise ActError(str(answer.message))
        return str(answer.message)

    def _ask(self, client: Any, request: Any) -> Any:
        """Ask until there is an answer: one that was killed is found for 20 s more, and what it was asked its successor does not know.

        To ask again changes nothing, and requests arrive in the order in which they were made.
        """
        end, news = time.monotonic() + ANSWER_S, threading.Event()
        futures: list[Any] = []
        self._awaited.add(news)
        try:
            while not (self._over.is_set() or any(future.done() for future in futures) or time.monotonic() > end):
                if not client.service_is_ready():
                    self._over.wait(LOOK_S)
                    continue
                futures.append(client.call_async(request))
                futures[-1].add_done_callback(lambda _: news.set())
                news.wait(min(AGAIN_S, max(0.0, end - time.monotonic())))
        finally:
            self._awaited.discard(news)
        for future in futures:
            if future.done():
                return future.result()
            client.remove_pending_request(future)
        if futures:
            raise ActError(f"the mission got the command and has not answered for {ANSWER_S:g} s, it may still obey; {LEFT}")
        raise ActError(f"the mission did not get the command: it can't be found; {LEFT}")
