"""Holds the events of skillsets against their models: each must be one that the semantics allows from the state before."""

from run_analysis.conformance.monitor import Finding, SkillsetMonitor
from run_analysis.conformance.runs import Monitor, Verdict

__all__ = ["Finding", "Monitor", "SkillsetMonitor", "Verdict"]
