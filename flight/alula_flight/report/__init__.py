"""What a run was: `make_report` reads the run's folder and writes its summary, timeline and map picture there."""

from alula_flight.report.facts import Death, RunFacts
from alula_flight.report.making import make_report
from alula_flight.report.summary import Summary

__all__ = ["Death", "RunFacts", "Summary", "make_report"]
