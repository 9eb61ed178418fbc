"""Distributes the runs of a campaign by Dask, here or on other machines, and adds their rows to the table as they finish."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

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
DEATHS = 1
"""So many workers may die with the same runs before these are left for the end: runs that end their worker would end all of them."""

Progress = Callable[[int], None]
"""Gets how many runs are in the table."""


def run(
    campaign: Campaign, table: Table, out: Path, progress: Progress, options: tuple[str, ...] = (), dask: str | None = None
) -> list[int]:
    """Do what is missing in the table; ``options`` are words of the command lines of live runs.

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
    from distributed import CancelledError, KilledWorker, as_completed

    # Dask samples what its workers do a hundred times a second; that is looked at nowhere.
    with (
        config.set({"distributed.worker.profile.enabled": False, "distributed.scheduler.allowed-failures": DEATHS}),
        _client(campaign, len(left), dask) as client,
    ):
        behaviour = tuple(str(path.absolute()) for path in campaign.behaviour)
        parts = list(_parts(left, 1 if campaign.over == SIMULATOR else TOGETHER))
        begin = partial(
            client.submit, rows_of, over=campaign.over, behaviour=behaviour, out=str(out.absolute()), options=options, pure=False
        )

        def take(future: Any) -> bool:
            """Add the rows of runs that are over; tell whether there are any."""
            try:
                table.add(future.result())
            except (KilledWorker, CancelledError):
                return False
            progress(len(table.rows))
            return True

        try:
            futures = {begin(part): part for part in parts}
            died = [futures[future] for future in as_completed(futures) if not take(future)]
            for part in died:  # one after another: whichever ends its worker now is alone there
                take(begin(part))
        finally:
            if campaign.over == SIMULATOR:
                end_live([planned for planned in left if planned.number not in table.rows], out)
    return [planned.number for planned in left if planned.number not in table.rows]


@contextmanager
def _client(campaign: Campaign, runs: int, dask: str | None) -> Iterator[Any]:
    """Connect to the scheduler at an address, or to one of this machine's own; raises AnalysisError."""
    from distributed import Client, LocalCluster

    with ExitStack() as stack:
        try:
            if dask is None:
                workers = min(campaign.at_once or os.cpu_count() or 1, runs)
                # Loopback only: nothing of a campaign can be reached from outside.
                cluster = stack.enter_context(
                    LocalCluster(
                        n_workers=workers, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0", silence_logs=50
                    )
                )
                client = stack.enter_context(Client(cluster))
            else:
                client = stack.enter_context(Client(dask, timeout=CONNECT_S))
        except (OSError, TimeoutError, ValueError) as error:
            raise AnalysisError(f"--dask {dask}: can't be used: {error}") from None
        yield client


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
