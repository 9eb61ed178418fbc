"""The tree of a mission's file as others see it while it runs: in the log of its run, and over Groot2's protocol."""

from __future__ import annotations

from alula.missions.director import Mission
from alula.missions.mission_file import MissionTrees
from alula.missions.record import STOP_LOG, MissionRecord
from alula.missions.skillset import Clock
from alula.trees.groot.address import Address, ServerError
from alula.trees.groot.watching import Watch
from alula.trees.tree import Tree


class WatchedTree:
    """A mission's tree that is logged where there is a record, and served where viewers are expected; after an abort what stops the robot.

    ``groot``: ``HOST:PORT``; empty: no viewers. Raises ServerError.
    """

    def __init__(self, mission: MissionTrees, clock_ns: Clock, record: MissionRecord | None, groot: str) -> None:
        self._clock_us = lambda: clock_ns() // 1000
        self._record = record
        self.problems: list[str] = []
        """What went wrong with logs and viewers."""
        self._watch = Watch(mission.tree, self._clock_us)
        self._server = None
        if groot:
            try:
                from alula.trees.groot.server import Server  # which alone needs pyzmq and msgpack
            except ModuleNotFoundError as error:
                raise ServerError(f"viewers need the Python package {error.name}; pip install 'alula[groot]' brings it") from None
            self._server = Server(self._watch.shown, Address.read(groot).looked_up())
        if record is not None:
            record.log_tree(self._watch)
        mission.on_stop = self._follow

    def commit(self) -> None:
        """Hand on what a step has changed."""
        self._watch.commit()

    def close(self) -> None:
        """End both."""
        if self._server is not None:
            self._server.close()
        self._close_watch()

    def _follow(self, stop: Tree) -> None:
        """Show what stops the robot from now on; it has to be ticked, whether it can be shown or not."""
        try:
            self._show(stop)
        except Exception as error:  # noqa: BLE001 - whatever breaks here, the robot has to come to rest
            self.problems.append(f"what stops the robot can't be shown: {type(error).__name__}: {error}")

    def _show(self, stop: Tree) -> None:
        self._close_watch()
        self._watch = Watch(stop, self._clock_us)
        if self._record is not None:
            self._record.log_tree(self._watch, STOP_LOG)
        if self._server is not None:
            self._server.show(self._watch.shown)

    def _close_watch(self) -> None:
        problem = self._watch.close()
        if problem:
            self.problems.append(problem)


def watched(mission: Mission, clock_ns: Clock, record: MissionRecord | None, groot: str) -> WatchedTree | None:
    """Return what shows the tree; None where nobody sees it. Raises ServerError."""
    if not isinstance(mission, MissionTrees) or not (groot or record is not None):
        return None
    return WatchedTree(mission, clock_ns, record, groot)
