"""Behaviour Trees in BehaviorTree.CPP 4's XML: base classes, ports and registration for nodes of one's own.

A node is a class: `SyncAction` and `Condition` answer in each tick, `Action` may take several ticks, `Decorator` has one child, `Control`
several. It declares its ``ports``, and `register` gives it the name that files use::

    @register("rover.Near")
    class Near(Condition):
        ports = (input_port("distance", DOUBLE, doc="to the dock", unit="m"), input_port("within", DOUBLE, "1"))

        def update(self) -> Answer:
            return SUCCESS if self.real("distance") < self.real("within") else FAILURE

The names here are public; the modules below are not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from alula.common.public import lazy_names

if TYPE_CHECKING:
    from alula.trees.errors import FileError, TickError, TreeError
    from alula.trees.node import Action, Condition, Control, Decorator, Leaf, Node, Script, SyncAction, register
    from alula.trees.ports import Port, inout_port, input_port, output_port, script_port
    from alula.trees.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Answer, Status
    from alula.trees.ticking import AGAIN, Begin, Order, Ticking
    from alula.trees.values import ANY, BOOL, DOUBLE, INT, STRING, UINT, PortType, list_of

__all__ = [
    "AGAIN",
    "ANY",
    "BOOL",
    "DOUBLE",
    "FAILURE",
    "IDLE",
    "INT",
    "RUNNING",
    "SKIPPED",
    "STRING",
    "SUCCESS",
    "UINT",
    "Action",
    "Answer",
    "Begin",
    "Condition",
    "Control",
    "Decorator",
    "FileError",
    "Leaf",
    "Node",
    "Order",
    "Port",
    "PortType",
    "Script",
    "Status",
    "SyncAction",
    "TickError",
    "Ticking",
    "TreeError",
    "inout_port",
    "input_port",
    "list_of",
    "output_port",
    "register",
    "script_port",
]

_DEFINED_IN = {
    "alula.trees.errors": ("FileError", "TickError", "TreeError"),
    "alula.trees.node": ("Action", "Condition", "Control", "Decorator", "Leaf", "Node", "Script", "SyncAction", "register"),
    "alula.trees.ports": ("Port", "inout_port", "input_port", "output_port", "script_port"),
    "alula.trees.status": ("FAILURE", "IDLE", "RUNNING", "SKIPPED", "SUCCESS", "Answer", "Status"),
    "alula.trees.ticking": ("AGAIN", "Begin", "Order", "Ticking"),
    "alula.trees.values": ("ANY", "BOOL", "DOUBLE", "INT", "STRING", "UINT", "PortType", "list_of"),
}

if not TYPE_CHECKING:  # so that a type checker knows these names and no others
    __getattr__, __dir__ = lazy_names(__name__, _DEFINED_IN, globals())
