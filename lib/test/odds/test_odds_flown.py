"""The odds, held against missions over mocks with the same figures: the same tree and managers, in virtual time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import pytest
from fetch_and_carry import by_hand
from odds_flights import Flights, only

from alula.campaign.mocked_scenarios import load_mocked_scenario
from alula.common.robots import find_robot
from alula.language.models import check_files, models_in
from alula.missions.director import Outcome
from alula.missions.mission_file import plan_of_file
from alula.missions.mocked import MockedMission
from alula.missions.part import NO_PART
from alula.mock import Behaviour, Ending, Rule
from alula.odds.figures import Figures
from alula.odds.odds import Odds, odds_of
from alula.odds.reading import load_figures
from alula.odds.robot import graph_of
from alula.records.causes.fault_file import effects_of_robot

CARRIER = Path(__file__).parent / "carrier"
FLIGHTS = 1000
DEVIATIONS = 3.29
"""A right chance is missed once in a thousand times; the seeds are fixed."""


@pytest.mark.long
def test_a_thousand_missions_over_mocks_are_within_the_confidence_interval() -> None:
    models = [one for file in check_files(models_in(str(CARRIER / "skillsets"))) for one in file.skillsets]
    figures = load_figures(CARRIER / "skillsets/faults.yaml", models).skills
    rules = {}
    for name, skill in figures.items():
        results = tuple((result, float(chance.low)) for result, chance in skill.results.items())
        skillset, _, of = name.partition(".")
        rules[skillset, of] = (Rule(delay=float(skill.lasts.low), ending=Ending(results=results)),)
    behaviour = Behaviour(rules=rules)
    plan = plan_of_file(CARRIER / "missions/retry.xml", "retry", models, {}, NO_PART)
    ends = [MockedMission(models, behaviour, plan, seed=seed).run().outcome for seed in range(FLIGHTS)]
    chance = float(by_hand(5))
    assert set(ends) == {Outcome.ACCOMPLISHED, Outcome.GIVEN_UP}
    assert abs(ends.count(Outcome.ACCOMPLISHED) / FLIGHTS - chance) <= DEVIATIONS * math.sqrt(chance * (1 - chance) / FLIGHTS)


# --- the drone's mapping -----------------------------------------------------------------------------------------------

DRONE = Path(__file__).parents[3]
MISSION = DRONE / "missions/mapping.xml"


def drones(others: Mapping[str, int] | None = None) -> tuple[Flights, Odds]:
    """Return flights of the drone's mission and its odds, by its own figures, or with other faults so many times an hour."""
    _, own = graph_of(MISSION, most=1)
    figures: Figures = own if others is None else only(own, others)
    graph, _ = graph_of(MISSION, others=figures, unlikely=1e-3)
    scenario = load_mocked_scenario("mapping")
    flights = Flights.by(scenario.plan, scenario.skillsets, scenario.behaviour, figures, effects_of_robot().known)
    return flights, odds_of(graph, figures, costs=False)


def within(odds: Odds, ends: list[Outcome]) -> bool:
    """Return whether how often each end was flown can come of its chances."""
    assert set(ends) <= {Outcome.ACCOMPLISHED, Outcome.DEGRADED, Outcome.GIVEN_UP}
    for outcome in (Outcome.ACCOMPLISHED, Outcome.DEGRADED, Outcome.GIVEN_UP):
        known = odds.outcomes[outcome.value]
        low, high = float(known.least.low), float(known.most.high)
        often = ends.count(outcome) / len(ends)
        if not low - deviation(low, len(ends)) <= often <= high + deviation(high, len(ends)):
            return False
    return True


def deviation(chance: float, flights: int) -> float:
    return DEVIATIONS * math.sqrt(chance * (1 - chance) / flights)


@pytest.fixture
def _drone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ALULA_ROBOT", str(DRONE))
    assert find_robot().root == DRONE


@pytest.mark.long
@pytest.mark.timeout(0)  # hundreds of flights: as long as the machine needs
@pytest.mark.usefixtures("_drone")
def test_a_thousand_mock_flights_of_the_drone_are_within_its_odds() -> None:
    flights, odds = drones()
    ends = [flights.fly(seed) for seed in range(FLIGHTS)]
    assert within(odds, ends)
    assert ends.count(Outcome.GIVEN_UP) > 0


@pytest.mark.long
@pytest.mark.timeout(0)  # hundreds of flights: as long as the machine needs
@pytest.mark.usefixtures("_drone")
def test_flights_in_which_sensors_often_fail_are_within_the_odds_and_not_within_those_of_others() -> None:
    flights, odds = drones({"zed": 10, "lidar": 5})
    ends = [flights.fly(seed) for seed in range(300)]
    assert within(odds, ends)
    assert min(ends.count(one) for one in (Outcome.ACCOMPLISHED, Outcome.DEGRADED, Outcome.GIVEN_UP)) > 10
    for others in ({"zed": 10}, {"zed": 2, "lidar": 5}):
        assert not within(drones(others)[1], ends), others
