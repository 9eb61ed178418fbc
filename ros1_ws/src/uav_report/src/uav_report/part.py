"""The drone's part of a report, as ``robot.yaml`` names it. For flights over mocks it reports that nothing was measured."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from alula.common.faults import FaultChange
from alula.records.causes.effects import EffectsByFault
from alula.records.causes.faults import Fault
from alula.report.observed import Observed
from alula.report.part import Entry, Findings, ReportedRun, ReportPart
from alula.report.phases import Phases
from alula.report.recovery import Recovery
from alula.report.timeline import Timeline

NOTHING_MEASURED = {
    "crash": None,
    "collisions": None,
    "min_clearance_m": None,
    "distance_m": None,
    "map": {"points": None, "coverage": None, "rmse_m": None, "patches_in_reach": None},
    "video": None,
}


def make(run: ReportedRun) -> ReportPart:
    """Make the part of a report."""
    if run.facts.mock:
        return Mocked()
    # Late: it needs ROS 1 and Open3D, which flights over mocks do without.
    from uav_report.flight import FlightReport

    return FlightReport(run)


class Mocked:
    """The part of a flight over mocks: there is no world to collide with or to map."""

    def observe(self, run: ReportedRun) -> Observed:  # noqa: ARG002
        """Return no observations: there is no functional bag."""
        return Observed()

    def failures(self, phases: Phases, known: Sequence[Fault], effects: EffectsByFault) -> Iterable[tuple[FaultChange, Fault]]:  # noqa: ARG002
        """Return no further faults."""
        return ()

    def measure(self, phases: Phases, recovery: Recovery | None, timeline: Timeline | None) -> Findings:  # noqa: ARG002
        """Report that nothing was measured."""
        return Findings(NOTHING_MEASURED)

    def entries(self) -> Iterable[Entry]:
        """Return no further entries for the page."""
        return ()
