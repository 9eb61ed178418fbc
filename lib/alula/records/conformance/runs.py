"""Holds the log of a whole run, of all its skillsets, against their models."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from alula.model.model import Skillset
from alula.records.conformance.monitor import Finding, SkillsetMonitor
from alula.runtime.core.events import EngineEvent


@dataclass(frozen=True)
class ConformanceVerdict:
    """Whether a log conforms.

    Attributes:
        events: how many were held against the models.
        findings: the first event of each skillset that does not conform, the earliest first.
        restarts: when managers were restarted, by skillset, seconds of mission clock.
        open: executions that had not ended when the log did, of skillsets without a finding.
        owed: what had to follow in the step with which the log ends, of the same.
        assumed: states, as ``skillset.resource == STATE``, without which it does not conform: of resources that no event is about, in which
            they would have been from the beginning on.
    """

    events: int
    findings: tuple[Finding, ...]
    restarts: Mapping[str, tuple[float, ...]]
    open: tuple[str, ...]
    owed: tuple[str, ...]
    assumed: tuple[str, ...] = ()

    @property
    def conforms(self) -> bool:
        """Return whether every event was allowed."""
        return not self.findings

    def as_dict(self) -> dict[str, object]:
        """Return the verdict as ``conform --json`` prints it."""
        found = {"conforms": self.conforms, "events": self.events, "findings": [finding.as_dict() for finding in self.findings]}
        return {
            **found,
            "restarts": {name: list(at) for name, at in self.restarts.items()},
            "open": list(self.open),
            "owed": list(self.owed),
            "assumed": list(self.assumed),
        }


class Monitor:
    """Follows all skillsets of a run; ``assumed``: by skillset, states of resources at the beginning, instead of their initial ones.

    Raises:
        UnsupportedModelError: a model can't be executed.
    """

    def __init__(self, skillsets: Iterable[Skillset], assumed: Mapping[str, Mapping[str, str]] = MappingProxyType({})) -> None:
        self.skillsets = tuple(skillsets)
        self._monitors = {one.name: SkillsetMonitor(one, assumed.get(one.name, {})) for one in self.skillsets}

    def take(self, event: EngineEvent) -> Finding | None:
        """Take the next event; return what does not conform, once a skillset.

        Raises:
            KeyError: there is no model of the event's skillset.
        """
        return self._monitors[event.skillset].take(event)

    @property
    def verdict(self) -> ConformanceVerdict:
        """The verdict up to now."""
        monitors = self._monitors
        findings = [monitor.finding for monitor in monitors.values() if monitor.finding is not None]
        return ConformanceVerdict(
            events=sum(monitor.events for monitor in monitors.values()),
            findings=tuple(sorted(findings, key=lambda finding: finding.stamp_s)),
            restarts={name: tuple(monitor.restarts) for name, monitor in monitors.items() if monitor.restarts},
            open=tuple(f"{name}.{one}" for name, monitor in monitors.items() for one in monitor.open if not monitor.finding),
            owed=tuple(f"{name}: {one}" for name, monitor in monitors.items() for one in monitor.owed if not monitor.finding),
            assumed=tuple(f"{name}.{one} == {state}" for name, monitor in monitors.items() for one, state in monitor.assumed.items()),
        )
