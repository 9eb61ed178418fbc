"""Holds the events of skillsets against their models: each must be one that the semantics allows from the state before."""

from alula.records.conformance.judging import judge
from alula.records.conformance.monitor import Finding, SkillsetMonitor
from alula.records.conformance.runs import ConformanceVerdict, Monitor

__all__ = ["ConformanceVerdict", "Finding", "Monitor", "SkillsetMonitor", "judge"]
