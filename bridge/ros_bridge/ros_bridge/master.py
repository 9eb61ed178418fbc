"""The ROS master: wait for it at the start, and register everything again after it was restarted."""

from __future__ import annotations

import http.client
import logging
import threading
from collections.abc import Callable
from typing import Any
from xml.parsers.expat import ExpatError
from xmlrpc.client import Error as XmlRpcError
from xmlrpc.client import ServerProxy

from ros_bridge.ros1_call import TimedTransport

logger = logging.getLogger("ros_bridge")

ANSWER_WITHIN_S = 1.0
ASK_EVERY_S = 0.2
UNKNOWN_NODE = -1


class Master:
    """The master, asked with a time limit over a connection that is kept."""

    def __init__(self, uri: str, caller_id: str) -> None:
        """Remember whom to ask, and as whom."""
        self.uri = uri
        self._caller_id = caller_id
        self._lock = threading.Lock()
        self._proxy: ServerProxy | None = None

    def knows(self, node: str) -> bool | None:
        """Tell whether the master knows a node; None when it does not answer."""
        with self._lock:
            try:
                self._proxy = self._proxy or ServerProxy(self.uri, transport=TimedTransport(ANSWER_WITHIN_S))
                answer: Any = self._proxy.lookupNode(self._caller_id, node)
                return bool(answer[0] != UNKNOWN_NODE)
            except (OSError, XmlRpcError, http.client.HTTPException, ExpatError, TypeError, IndexError):  # or garbage comes from there
                self._proxy = None
                return None

    def wait(self, stop: threading.Event) -> bool:
        """Wait until the master answers, saying so once; False when asked to stop before."""
        if self.knows(self._caller_id) is not None:
            return True
        logger.warning("waiting for a ROS master at %s", self.uri)
        while not stop.wait(ASK_EVERY_S / 2):
            if self.knows(self._caller_id) is not None:
                logger.info("the ROS master is there")
                return True
        return False


class MasterWatch:
    """A thread that asks the master five times a second whether it still knows this node."""

    def __init__(self, master: Master, node: str, register_again: Callable[[], None], changed: Callable[[], None]) -> None:
        """Call ``register_again`` whenever the master answers but has forgotten the node, ``changed`` when it comes or goes."""
        self._master = master
        self._node = node
        self._register_again = register_again
        self._changed = changed
        self._stop = threading.Event()
        self.reachable = True
        self._thread = threading.Thread(target=self._run, name="master_watch", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._stop.wait(ASK_EVERY_S):
            known = self._master.knows(self._node)
            if (known is not None) != self.reachable:
                self.reachable = known is not None
                logger.warning("the ROS master at %s %s", self._master.uri, "is back" if self.reachable else "does not answer")
                self._changed()
            if known is False and not self._stop.is_set():
                self._mend()

    def _mend(self) -> None:
        logger.warning("the ROS master has forgotten %s (it was restarted): registering everything again", self._node)
        try:
            self._register_again()
        except Exception:  # the master went again; the next round sees to it
            logger.exception("registering again failed")

    def close(self) -> None:
        """Stop asking."""
        self._stop.set()
