"""Entries of the page that only the recordings of the functional layer have: the path, the verdicts of the watches, the true surfaces."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from alula.report.page.entries import HEALTH, PATH, TOLD, WORLD, Wire
from uav_report.recording import Recording, Track
from uav_report.world import TrueSurfaces

PATH_PERIOD_S = 0.2


def page_entries(recording: Recording, world: TrueSurfaces | None) -> Iterator[Wire]:
    """Yield entries for the page besides those of the run's folder."""
    if world is not None:
        yield WORLD, None, [[round(float(value), 2) for value in edge.reshape(-1)] for edge in world.outline()]
    if recording.path is not None:
        yield from _path(recording.path)
    for change in recording.health:
        said = {"sensor": change.sensor, "ok": change.ok, "fault": change.fault, "reason": change.reason}
        yield HEALTH, round(change.t_s, 3), said
    for t_s, text in recording.told:
        yield TOLD, round(t_s, 3), {"words": text}


def _path(path: Track) -> Iterator[Wire]:
    """Yield five places a second."""
    _, first = np.unique(np.floor(path.t_s / PATH_PERIOD_S), return_index=True)
    for t_s, place in zip(path.t_s[first], path.position_enu_m[first], strict=True):
        yield PATH, round(float(t_s), 3), [round(float(value), 3) for value in place]
