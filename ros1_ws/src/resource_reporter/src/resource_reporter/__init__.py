"""Extern transitions: the functional layer says which state a resource has, this package sees to it that the skillset knows.

Also: what the functional layer is told by services, as messages (``ToldService``), how far a node has come (``DoneReporter``), and that its
messages are sent without waking a thread for each (``send_directly``).
"""

from resource_reporter.calls import ToldService
from resource_reporter.done import DoneReporter
from resource_reporter.ledger import Call, Ledger
from resource_reporter.reporter import ResourceReporter
from resource_reporter.sending import send_directly

__all__ = ["Call", "DoneReporter", "Ledger", "ResourceReporter", "ToldService", "send_directly"]
