"""``./alula campaign``: does a campaign, goes on where it stopped, and ends with the failure coverage.

Ends with 0: all done, 1: done, and runs had trouble, or responses that the proof does not know, 2: could not start, or could not write
its folder any more.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from alula.campaign.beside import MissionResponses, beside
from alula.campaign.coverage import Coverage, cover, processes
from alula.campaign.failures import ways_to_fail
from alula.campaign.mocked_scenarios import load_mocked_scenario
from alula.campaign.plan import MOCKS, Campaign, load_campaign
from alula.campaign.proved import proved
from alula.campaign.rendering import as_page, as_text
from alula.campaign.running import check_live_faults, offer_of, options_of, run
from alula.campaign.table import ROWS, Row, Table
from alula.cli.table import parse
from alula.common.files import write_json, write_text
from alula.common.garbage import collect_seldom
from alula.common.robots import RobotError
from alula.common.runs import runs_folder
from alula.common.scenarios import ScenarioError, load_scenario, scenario_names
from alula.records.causes.fault_file import effects_of_robot
from alula.records.errors import AnalysisError
from alula.records.models import robot_skillsets
from alula.runtime.live.options import RunOffer

DONE, TROUBLE, CANNOT_START = 0, 1, 2
SHOW_EVERY_S = 1.0


def check_faults(campaign: Campaign, offer: RunOffer) -> None:
    """Refuse faults that the runs of a scenario can't have, and a robot's file of faults that is wrong; raises AnalysisError."""
    effects_of_robot()
    if campaign.over != MOCKS:
        check_live_faults(campaign, offer)
    else:
        scenarios = {name: load_mocked_scenario(name, campaign.behaviour) for name in campaign.scenarios}
        for planned in campaign.runs:
            scenarios[planned.scenario].check(planned.requests)


class Teller:
    """Says on standard error how far a campaign is, once a second."""

    def __init__(self, runs: int, begun: int) -> None:
        self._runs = runs
        self._begun = begun
        self._since = self._said = time.monotonic()

    def __call__(self, done: int) -> None:
        """Write how many runs are done, their rate and the time left to stderr, at most every ``SHOW_EVERY_S``."""
        now = time.monotonic()
        if now - self._said >= SHOW_EVERY_S or done == self._runs:
            self._said = now
            rate = (done - self._begun) / max(now - self._since, 1e-9)
            left_s = (self._runs - done) / max(rate, 1e-9)
            sys.stderr.write(f"{done} of {self._runs} runs, {rate:.1f} a second, {left_s:.0f} s left\n")
            sys.stderr.flush()


def responses_of(campaign: Campaign, rows: Sequence[Row], time_s: float) -> list[MissionResponses]:
    """Return the responses of each mission of a campaign over mocks, flown beside proved; live runs don't tell theirs."""
    if campaign.over != MOCKS:
        return []
    found, models, effects = [], robot_skillsets(), effects_of_robot()
    for name in dict.fromkeys(campaign.scenarios):
        tell = partial(_tell_proof, name)
        mission = proved(load_scenario(name), models, effects, tell, time_s)
        found.append(beside(name, mission, [row for row in rows if row["scenario"] == name]))
    return found


def _tell_proof(scenario: str, progress: str) -> None:
    sys.stderr.write(f"looking at all runs of {scenario}: {progress}\n")


def finish(campaign: Campaign, table: Table, out: Path, title: str, time_s: float) -> Coverage:
    """Order the table and write the coverage beside it."""
    table.finish()
    rows = [table.rows[number] for number in sorted(table.rows)]
    ways = ways_to_fail(robot_skillsets(), processes(map(load_scenario, scenario_names())))
    coverage = cover(rows, ways, responses_of(campaign, rows, time_s))
    write_json(out / "coverage.json", coverage.as_dict())
    write_text(out / "coverage.txt", as_text(coverage))
    write_text(out / "coverage.html", as_page(coverage, title))
    return coverage


def _listed(numbers: Sequence[int], most: int = 20) -> str:
    return ", ".join(map(str, numbers[:most])) + (", ..." if len(numbers) > most else "")


def main(arguments: Sequence[str] | None = None) -> int:
    """Do it; return the exit code."""
    given = parse("campaign", arguments)
    collect_seldom()
    out = given.out or runs_folder() / f"campaign-{given.file.stem}"
    try:
        campaign = load_campaign(given.file)
        offer = offer_of(campaign)
        check_faults(campaign, offer)
        options = options_of(campaign, offer)
        table = Table(out, campaign)
        if table.rows:
            sys.stderr.write(f"{len(table.rows)} of {len(campaign.runs)} runs are in {out / ROWS}\n")
        lost = run(campaign, table, out, Teller(len(campaign.runs), len(table.rows)), options, given.dask)
        coverage = finish(campaign, table, out, f"Campaign {given.file.stem}", given.time)
    except (AnalysisError, RobotError, ScenarioError) as error:
        sys.stderr.write(f"alula campaign: {error}\n")
        return CANNOT_START
    except OSError as error:
        sys.stderr.write(f"alula campaign: {out}: can't be written any more: {error.strerror or error}\n")
        return CANNOT_START
    except KeyboardInterrupt:
        sys.stderr.write(f"interrupted; the same command goes on from {out / ROWS}\n")
        return TROUBLE
    sys.stdout.write(as_text(coverage))
    sys.stderr.write("".join(f"alula campaign: {line}\n" for line in coverage.unknown))
    sys.stderr.write(f"{out / 'coverage.html'}\n")
    if lost:
        sys.stderr.write(
            f"alula campaign: {len(lost)} runs were lost with their workers ({_listed(lost)}); the same command does them again\n"
        )
    return TROUBLE if lost or coverage.troubled or coverage.unknown else DONE


if __name__ == "__main__":
    sys.exit(main())
