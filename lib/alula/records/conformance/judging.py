"""Holds a log against the models of its skillsets."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from alula.common.robots import meaning
from alula.common.runs import robot_of
from alula.model.errors import UnsupportedModelError
from alula.records.conformance.runs import ConformanceVerdict, Monitor
from alula.records.errors import AnalysisError
from alula.records.logs import Log
from alula.records.models import models_of


def judge(log: Log, models: Sequence[Path] = ()) -> ConformanceVerdict:
    """Hold a log against models: those of files, else those of the robot that its own files name, else of the one that is meant.

    Raises:
        AnalysisError: a model is missing, has errors or can't be executed.
    """
    try:
        with meaning(robot_of(log.path)):
            monitor = Monitor(models_of(log.skillsets, models))
    except UnsupportedModelError as error:
        raise AnalysisError(str(error)) from None
    for event in log.events:
        monitor.take(event)
    return monitor.verdict
