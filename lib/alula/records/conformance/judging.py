"""Holds a log against the models of its skillsets."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from alula.model.errors import UnsupportedModelError
from alula.records.conformance.runs import ConformanceVerdict, Monitor
from alula.records.errors import AnalysisError
from alula.records.logs import Log
from alula.records.models import models_of


def judge(log: Log, models: Sequence[Path] = ()) -> ConformanceVerdict:
    """Hold a log against models.

    Raises:
        AnalysisError: a model is missing, has errors or can't be executed.
    """
    try:
        monitor = Monitor(models_of(log.skillsets, models))
    except UnsupportedModelError as error:
        raise AnalysisError(str(error)) from None
    for entry in log.entries:
        monitor.take(entry.event, entry.instance_id)
    return monitor.verdict
