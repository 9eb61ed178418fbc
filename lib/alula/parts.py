"""What a robot's parts are made of (``parts`` of its ``robot.yaml``: docs/reference/robots.md), and what its simulator reads.

``missions``: a `MissionPart`, nodes of its own. ``inputs``: a function from the file of a world to `Inputs`, which raises InputError.
``run``: a `RunPart`, options of its live runs and what the death of a node means. ``report``: a `ReportPart`, made of a `ReportedRun`.
Faults that a simulator brings about: `FaultRequest`, `parse_faults`, `FaultChange`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from alula.common.public import lazy_names

if TYPE_CHECKING:
    from alula.common.faults import MENDED, FaultChange, FaultError, FaultRequest, parse_faults
    from alula.common.robots import load_part
    from alula.common.scenarios import Scenario
    from alula.common.signals import StopEvent
    from alula.missions.part import MissionPart
    from alula.missions.plan import InputError, Inputs
    from alula.report.part import Entry, Findings, NoPart, ReportedRun, ReportPart, Task
    from alula.report.phases import Phases
    from alula.runtime.core.records import ExecutionRecord
    from alula.runtime.live.part import Clock, Consequence, RunPart
    from alula.runtime.live.spec import RequestError, RunSpec

__all__ = [
    "MENDED",
    "Clock",
    "Consequence",
    "Entry",
    "ExecutionRecord",
    "FaultChange",
    "FaultError",
    "FaultRequest",
    "Findings",
    "InputError",
    "Inputs",
    "MissionPart",
    "NoPart",
    "Phases",
    "ReportPart",
    "ReportedRun",
    "RequestError",
    "RunPart",
    "RunSpec",
    "Scenario",
    "StopEvent",
    "Task",
    "load_part",
    "parse_faults",
]

_DEFINED_IN = {
    "alula.common.faults": ("MENDED", "FaultChange", "FaultError", "FaultRequest", "parse_faults"),
    "alula.common.robots": ("load_part",),
    "alula.common.scenarios": ("Scenario",),
    "alula.common.signals": ("StopEvent",),
    "alula.runtime.live.part": ("Clock", "Consequence", "RunPart"),
    "alula.runtime.live.spec": ("RequestError", "RunSpec"),
    "alula.missions.part": ("MissionPart",),
    "alula.missions.plan": ("InputError", "Inputs"),
    "alula.report.part": ("Entry", "Findings", "NoPart", "ReportPart", "ReportedRun", "Task"),
    "alula.report.phases": ("Phases",),
    "alula.runtime.core.records": ("ExecutionRecord",),
}

if not TYPE_CHECKING:  # so that a type checker knows these names and no others
    __getattr__, __dir__ = lazy_names(__name__, _DEFINED_IN, globals())
