"""A run without a mission: it serves, until it is told to end."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from alula.campaign.mocked_scenarios import load_mocked_scenario
from alula.common.scenarios import Scenario
from alula.missions.director import EXIT_CODES, Outcome
from alula.missions.driver import MissionDriver
from alula.missions.scenario import plan_of
from alula.records.errors import AnalysisError


def serving(*, ready: bool = True) -> tuple[MissionDriver, SimpleNamespace]:
    client = SimpleNamespace(ready=ready)
    plan = plan_of(Scenario("standby", "serves", ("base",)), {}, ())
    return MissionDriver(plan, lambda _name, _wake: client, lambda: 1_000_000_000, {}), client


def test_it_serves_until_it_is_told_to_end():
    driver, _ = serving()
    for _ in range(100):
        driver.tick()
    assert driver.director.start_s == 1.0
    assert driver.end is None
    driver.abort("told to end by SIGINT")
    while driver.end is None:
        driver.tick()
    assert (driver.end.outcome, driver.end.reason) == (Outcome.SERVED, "told to end by SIGINT")
    assert EXIT_CODES[Outcome.SERVED] == 0
    assert driver.director.view().name == "serve"


def test_it_has_not_served_before_its_skillsets_answer():
    driver, client = serving(ready=False)
    driver.tick()
    assert [one.unmet for one in driver.director.conditions()] == ["the skillset base can't be called"]
    driver.abort("told to end by SIGINT")
    assert driver.end is not None
    assert driver.end.outcome is Outcome.ABORTED
    assert not client.ready


def test_over_mocks_it_says_who_serves_them():
    with pytest.raises(AnalysisError, match="has no mission to be run over mocks; `alula mock` serves its skills"):
        load_mocked_scenario("standby")
