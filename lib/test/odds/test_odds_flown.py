"""The odds, held against missions over mocks with the same figures: the same tree and managers, in virtual time."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from fetch_and_carry import by_hand

from alula.language.models import check_files, models_in
from alula.missions.director import Outcome
from alula.missions.filed.part import NO_PART
from alula.missions.filed.plan import plan_of_file
from alula.missions.mocked import MockedMission
from alula.odds.reading import load_figures
from alula.runtime.mock import Behaviour, Ending, Rule

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
