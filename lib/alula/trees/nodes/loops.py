"""Nodes that tick their child once for each item of a list."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from alula.trees.ends import ANY_END, FAILS, Ends, Given, answer_in
from alula.trees.errors import TickError
from alula.trees.node import Decorator, NodeConfig, pointer
from alula.trees.ports import inout_port, input_port, output_port
from alula.trees.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Answer, Skipped, Status
from alula.trees.ticking import AGAIN, Begin, Order, Ticking
from alula.trees.values import BOOL, DOUBLE, INT, STATUS, STRING, PortType, StandIn, list_of


class Loop(Decorator):
    """Takes the items of a list one by one, writes each into ``value``, and ticks its child with it; fails with the child.

    A list of the file begins anew each time; one of the blackboard is used up.
    """

    may_run = True
    ticking = Ticking(Order.SINGLE, after=dict.fromkeys((SUCCESS, SKIPPED), frozenset({AGAIN, *ANY_END})), begins=Begin.PERHAPS)
    remembers = ("_running", "_items")

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:
        """Fail with the child, or end as `if_empty` says."""
        return (children[0] & FAILS) | answer_in(given, "if_empty")

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._running = False
        self._items: list[object] | None = None
        self._fixed: list[object] | None = None
        if pointer(config.ports.get("queue", ""), "queue") is None:
            self._fixed = self._list(config.ports.get("queue", ""))

    def update(self) -> Answer:
        """Follow the child while it runs, else take the next item."""
        if self.status is IDLE:
            self._running = False
            self._items = None if self._fixed is None else list(self._fixed)
        if not self._running:
            if self._fixed is None:
                self._take()
            if not self._items:
                return self._if_empty()
            self.put("value", self._items.pop(0))
        if self.status is IDLE:
            self.become(RUNNING)
        answer = self.child.execute()
        self._running = answer is RUNNING
        if answer is SUCCESS or answer is FAILURE:
            self.reset_children()
        return FAILURE if answer is FAILURE else RUNNING

    def _take(self) -> None:
        """Have the list that the blackboard has; text is read once for a run of this node."""
        entry = self.entry("queue")
        value = None if entry is None else entry.value
        if isinstance(value, StandIn):
            self._items = self._list(value)
        elif isinstance(value, list):
            self._items = value
        elif isinstance(value, tuple | str) and self._items is None:
            self._items = self._list(value)
        elif value is None and self._items is None:
            raise TickError(f"{self.place()}: the port 'queue' reads '{self.config.ports['queue']}', which nothing has written")
        elif value is not None and not isinstance(value, tuple | str):
            raise TickError(f"{self.place()}: the port 'queue' reads no list")

    def _list(self, value: object) -> list[object]:
        try:
            items = list_of(self.config.type.ports["value"].type).read(value)
        except ValueError as error:
            raise TickError(f"{self.place()}: the port 'queue': {error}") from None
        return items if isinstance(items, list) else []

    def _if_empty(self) -> Answer:
        answer = self.get("if_empty")
        return answer if isinstance(answer, Status | Skipped) else SKIPPED


def _loop(name: str, item: PortType) -> type[Loop]:
    ports = (
        replace(inout_port("queue", doc="a list, or text with semicolons between its items"), required=True),
        input_port("if_empty", STATUS, "SUCCESS", "what it answers when there are no more items"),
        output_port("value", item, doc="the item"),
    )
    return type(name, (Loop,), {"ports": ports, "__doc__": Loop.__doc__, "__module__": __name__})


LOOPS = (_loop("LoopInt", INT), _loop("LoopBool", BOOL), _loop("LoopDouble", DOUBLE), _loop("LoopString", STRING))
