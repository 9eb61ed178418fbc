"""Holds a log against the models of its skillsets."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations, islice, product
from pathlib import Path

from alula.common.robots import meaning
from alula.common.runs import robot_of
from alula.model.errors import UnsupportedModelError
from alula.model.model import Skillset
from alula.records.conformance.monitor import SkillsetMonitor
from alula.records.conformance.runs import ConformanceVerdict, Monitor
from alula.records.errors import AnalysisError
from alula.records.logs import Log
from alula.records.models import models_of
from alula.runtime.core.events import EngineEvent, TransitionEvent

MOST_STARTS = 256
"""So many states at the beginning are tried at most."""


def judge(log: Log, models: Sequence[Path] = ()) -> ConformanceVerdict:
    """Hold a log against models: those of files, else those of the robot that its own files name, else of the one that is meant.

    A log may be older than its model. One that does not conform is held against it once more with other states at the beginning of the
    resources that no event is about; with which it conforms is told.

    Raises:
        AnalysisError: a model is missing, has errors or can't be executed.
    """
    try:
        with meaning(robot_of(log.path)):
            skillsets = models_of(log.skillsets, models)
        verdict = _followed(Monitor(skillsets), log.events)
        failing = {finding.skillset for finding in verdict.findings}
        assumed = {one.name: found for one in skillsets if one.name in failing and (found := _assumed(one, log.events))}
        return _followed(Monitor(skillsets, assumed), log.events) if assumed else verdict
    except UnsupportedModelError as error:
        raise AnalysisError(str(error)) from None


def _followed(monitor: Monitor, events: Iterable[EngineEvent]) -> ConformanceVerdict:
    for event in events:
        monitor.take(event)
    return monitor.verdict


def _assumed(skillset: Skillset, events: Iterable[EngineEvent]) -> Mapping[str, str]:
    """Return the fewest states at the beginning, of resources that no event is about, with which all events conform; none: no such."""
    own = [event for event in events if event.skillset == skillset.name]
    told = {event.resource for event in own if isinstance(event, TransitionEvent)}
    untold = [one for one in skillset.resources if one.name not in told]
    starts = [[(one.name, state) for state in one.states if state != one.initial] for one in untold]
    several = (pairs for count in range(1, len(starts) + 1) for some in combinations(starts, count) for pairs in product(*some))
    for pairs in islice(several, MOST_STARTS):
        monitor = SkillsetMonitor(skillset, dict(pairs))
        if all(monitor.take(event) is None for event in own):
            return dict(pairs)
    return {}
