"""The tree of a mission's file as others see it while it runs: in the log of its run, and over Groot2's protocol."""

from __future__ import annotations

from alula.missions.director import Mission
from alula.missions.filed.plan import FiledMission
from alula.missions.record import MissionRecord
from alula.missions.skillset import Clock
from alula.trees.groot.address import Address, ServerError
from alula.trees.groot.watching import Watch
from alula.trees.tree import Tree


class WatchedTree:
    """A tree that is logged where there is a record, and served where viewers are expected.

    ``groot``: ``HOST:PORT``; empty: no viewers. Raises ServerError.
    """

    def __init__(self, tree: Tree, clock_ns: Clock, record: MissionRecord | None, groot: str) -> None:
        self._watch = Watch(tree, lambda: clock_ns() // 1000)
        self._server = None
        if groot:
            try:
                from alula.trees.groot.server import Server  # which alone needs pyzmq and msgpack
            except ModuleNotFoundError as error:
                raise ServerError(f"viewers need the Python package {error.name}; pip install 'alula[groot]' brings it") from None
            self._server = Server(self._watch.shown, Address.read(groot).looked_up())
        if record is not None:
            record.log_tree(self._watch)

    def commit(self) -> None:
        """Hand on what a step has changed."""
        self._watch.commit()

    def close(self) -> str:
        """End both; return what went wrong with the log."""
        if self._server is not None:
            self._server.close()
        return self._watch.close()


def watched(mission: Mission, clock_ns: Clock, record: MissionRecord | None, groot: str) -> WatchedTree | None:
    """Return what shows the tree; None where nobody sees it. Raises ServerError."""
    if not isinstance(mission, FiledMission) or not (groot or record is not None):
        return None
    return WatchedTree(mission.tree, clock_ns, record, groot)
