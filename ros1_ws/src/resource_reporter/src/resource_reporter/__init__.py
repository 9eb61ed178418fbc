"""Extern transitions: the functional layer reports which state a resource has, this package brings the report to the skillset.

Also: what the functional layer is told by services, as messages (``ToldService``), how far a node has come (``DoneReporter``), and that its
messages are sent without waking a thread for each (``send_directly``). For nodes beside it: calls of services that end in time
(``ServiceCaller``), and threads whose errors end the node (``ends_the_node``).
"""

from resource_reporter.caller import CallFailedError, ServiceCaller
from resource_reporter.calls import ToldService
from resource_reporter.done import DoneReporter
from resource_reporter.failing import ends_the_node
from resource_reporter.ledger import Call, Ledger
from resource_reporter.reporter import ResourceReporter
from resource_reporter.sending import send_directly

__all__ = [
    "Call",
    "CallFailedError",
    "DoneReporter",
    "Ledger",
    "ResourceReporter",
    "ServiceCaller",
    "ToldService",
    "ends_the_node",
    "send_directly",
]
