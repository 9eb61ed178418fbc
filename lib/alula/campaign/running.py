"""Distributes the runs of a campaign by Dask, here or on other machines, and adds their rows to the table as they finish."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil

from alula.campaign.live import end_live
from alula.campaign.plan import SIMULATOR, Campaign, PlannedRun
from alula.campaign.rows import rows_of
from alula.campaign.table import Table
from alula.common.faults import FaultError, parse_fault
from alula.common.robots import find_robot
from alula.common.scenarios import load_scenario
from alula.records.errors import AnalysisError
from alula.runtime.live.options import RunOffer, ask_offer, words_of
from alula.runtime.live.spec import RequestError

TOGETHER = 10
"""Mock runs that are handed over at a time: a run takes tens of milliseconds."""
CONNECT_S = 30.0
LOOK_S = 2.0  # wall clock; how often it is looked whether there are workers
DEATHS = 1
"""So many workers may die with the same runs before these are left for the end: runs that end their worker would end all of them."""

Part = Sequence[PlannedRun]
"""Runs that are handed over together."""
Progress = Callable[[int], None]
"""Gets how many runs are in the table."""


def run(
    campaign: Campaign, table: Table, out: Path, progress: Progress, options: tuple[str, ...] = (), dask: str | None = None
) -> list[int]:
    """Do the runs that the table lacks; ``options`` are words of the command lines of live runs.

    A worker that dies loses only the run that it did: others do again what it had, and what it had as the next.

    Returns:
        The numbers of the runs that are missing still, because whoever did them died.

    Raises:
        AnalysisError: there is no Dask scheduler at the address.
    """
    left = [planned for planned in campaign.runs if planned.number not in table.rows]
    if not left:
        return []
    from dask import config  # late: it takes a second, and a finished campaign does not need it
    from distributed import CancelledError, KilledWorker

    # Dask samples what its workers do a hundred times a second; that is looked at nowhere.
    settings = {"distributed.worker.profile.enabled": False, "distributed.scheduler.allowed-failures": DEATHS}
    with config.set(settings), _workers(campaign, len(left), dask) as workers:
        behaviour = tuple(str(path.absolute()) for path in campaign.behaviour)
        words: dict[str, Any] = {"over": campaign.over, "behaviour": behaviour, "out": str(out.absolute()), "options": options}

        def do(parts: Iterable[Part]) -> list[Part]:
            """Do runs, and add their rows as they come; return those of which each worker died."""
            futures = {workers.client.submit(rows_of, part, **words, pure=False): part for part in parts}
            died = []
            for future in workers.finished(futures):
                try:
                    table.add(future.result())
                except (KilledWorker, CancelledError):
                    died.append(futures[future])
                    continue
                progress(len(table.rows))
            return died

        try:
            for part in do(_parts(left, 1 if campaign.over == SIMULATOR else TOGETHER)):
                do([part])  # whichever ends its worker now is alone there
        finally:
            if campaign.over == SIMULATOR:
                end_live([planned for planned in left if planned.number not in table.rows], out)
    return [planned.number for planned in left if planned.number not in table.rows]


@dataclass
class _Workers:
    """The workers of a scheduler; ``cluster`` is this machine's own, None: they are somebody else's."""

    client: Any
    cluster: Any = None
    count: int = 0

    def finished(self, futures: Iterable[Any]) -> Iterator[Any]:
        """Yield futures as they are finished. Workers of this machine that have died, and that Dask does not start again, are replaced."""
        from distributed import TimeoutError as StillOpenError
        from distributed import wait

        left, gone = set(futures), 0
        while left:
            try:
                done, left = wait(left, timeout=LOOK_S, return_when="FIRST_COMPLETED")
            except StillOpenError:
                gone = gone + 1 if self.cluster is not None and not self._alive() else 0
                if gone > 1:  # Dask itself needs a moment to start another one
                    self.cluster.scale(0)
                    self.cluster.scale(self.count)
                    gone = 0
                continue
            yield from done

    def _alive(self) -> bool:
        """Return whether any process of a worker lives: one that dies in its first moment is not started again by Dask."""
        return any(worker.pid and psutil.pid_exists(worker.pid) for worker in self.cluster.workers.values())


@contextmanager
def _workers(campaign: Campaign, runs: int, dask: str | None) -> Iterator[_Workers]:
    """Connect to the scheduler at an address, or to one of this machine's own; raises AnalysisError."""
    from distributed import Client, LocalCluster

    with ExitStack() as stack:
        try:
            if dask is not None:
                workers = _Workers(stack.enter_context(Client(dask, timeout=CONNECT_S)))
            else:
                count = min(campaign.at_once or os.cpu_count() or 1, runs)
                # Loopback only: nothing of a campaign can be reached from outside.
                cluster = stack.enter_context(
                    LocalCluster(n_workers=count, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0", silence_logs=50)
                )
                workers = _Workers(stack.enter_context(Client(cluster)), cluster, count)
        except (OSError, TimeoutError, ValueError) as error:
            raise AnalysisError(f"--dask {dask}: can't be used: {error}") from None
        yield workers


def offer_of(campaign: Campaign) -> RunOffer:
    """Return what the robot declares for live runs; nothing where a campaign has none. Raises AnalysisError."""
    try:
        return asyncio.run(ask_offer()) if campaign.over == SIMULATOR else RunOffer()
    except RequestError as error:
        raise AnalysisError(str(error)) from None


def check_live_faults(campaign: Campaign, offer: RunOffer) -> None:
    """Refuse faults that the live runs of a scenario can't have; raises AnalysisError."""
    known = {name: {**offer.faults, **dict(load_scenario(name).faults)} for name in campaign.scenarios}
    for planned in () if find_robot().robots else campaign.runs:  # a fleet's robots each know their own
        for text in planned.faults:
            try:
                parse_fault(text, known[planned.scenario])
            except FaultError as error:
                raise AnalysisError(f"the scenario {planned.scenario}: {error}") from None


def options_of(campaign: Campaign, offer: RunOffer) -> tuple[str, ...]:
    """Return the options of its live runs as words of their command lines; raises AnalysisError where the robot has no such options."""
    limit = [f"--limit={campaign.limit_s:g}"] if campaign.limit_s else []
    try:
        return (*words_of(campaign.options, offer.options), *limit)
    except RequestError as error:
        raise AnalysisError(f"`options`: {error}") from None


def _parts(runs: Sequence[PlannedRun], size: int) -> Iterator[Sequence[PlannedRun]]:
    for begin in range(0, len(runs), size):
        yield runs[begin : begin + size]
