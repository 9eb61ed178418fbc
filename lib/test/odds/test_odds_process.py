"""Processes of small systems, against what is calculated by hand and by numpy."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tables import ACCOMPLISHED, GIVEN_UP, Table, chances, end, fault, now, storm

from alula.odds.figures import ANY_CHANCE, ANY_RATE, FaultFigures, Figures, Range, SkillFigures, corners, point
from alula.odds.graph import explore
from alula.odds.process import Choice, Process, quantify
from alula.odds.storm import Storm
from alula.odds.system import DEPARTURE, Kind, Outcome, Step

FLIGHT = {"begin": [now("flying", "fly")], "flying": [end("fly", "DONE", "accomplished"), fault("motor", "given_up")]}


def test_a_fault_races_with_a_skill() -> None:
    # One in 3600 s, against a flight of 60 s: 60 / 3660 of the flights end by the fault.
    figures = Figures({"motor": FaultFigures(rate=point("1/3600"))}, {"fly": SkillFigures(lasts=point(60))})
    asked = storm(FLIGHT, figures)
    assert chances(asked) == (Fraction(60, 61), Fraction(60, 61))
    assert chances(asked, GIVEN_UP) == (Fraction(1, 61), Fraction(1, 61))
    # Whichever comes first: 1 / (1/60 + 1/3600).
    assert asked.seconds(most=True) == asked.seconds(most=False)
    assert asked.seconds(most=True).low == Fraction(3600, 61)
    # P = (1/60) / (1/60 + rate), so dP/drate = - (1/60) / (1/60 + rate)^2.
    assert asked.slopes(asked.chance([ACCOMPLISHED], most=False))["motor"] == pytest.approx(-(1 / 60) / (1 / 60 + 1 / 3600) ** 2)


def test_more_stages_come_near_to_a_fixed_time() -> None:
    rate, lasts = Fraction(1, 600), 300
    fixed = np.exp(-float(rate) * lasts)
    errors = []
    for stages in (1, 4, 16, 64):
        figures = Figures({"motor": FaultFigures(rate=point(rate))}, {"fly": SkillFigures(lasts=point(lasts), stages=stages)})
        low, high = chances(storm(FLIGHT, figures))
        assert low == high == (Fraction(stages, lasts) / (Fraction(stages, lasts) + rate)) ** stages
        errors.append(float(low) - fixed)
    assert all(before > after > 0 for before, after in itertools.pairwise(errors))
    assert errors[0] == pytest.approx(0.06, abs=0.005)
    assert errors[-1] < 0.0012


def test_a_second_unit_has_to_fail_too() -> None:
    figures = Figures({"motor": FaultFigures(rate=point("1/600"))}, {"fly": SkillFigures(lasts=point(60))})
    assert chances(storm(FLIGHT, figures), GIVEN_UP)[0] == Fraction(1, 11)
    # First either of two, then the other, before the flight is over: 2/(2+10) times 1/(1+10).
    assert chances(storm(FLIGHT, figures.with_fault("motor", units=2)), GIVEN_UP)[0] == Fraction(2, 12) * Fraction(1, 11)


def test_a_fault_at_a_use_comes_then_or_not() -> None:
    table = {"begin": [now("flying", DEPARTURE, "fly")], "flying": [end("fly", "DONE", "accomplished"), fault("motor", "given_up")]}
    motor = FaultFigures(rate=point(0), chances={DEPARTURE: point("0.01"), "fly": point("0.02")})
    asked = storm(table, Figures({"motor": motor}, {"fly": SkillFigures(lasts=point(60))}))
    assert chances(asked) == (Fraction(99, 100) * Fraction(98, 100),) * 2
    assert asked.slopes(asked.chance([ACCOMPLISHED], most=False))["motor at departure"] == pytest.approx(-0.98)


def test_a_figure_that_is_missing_is_a_range() -> None:
    flown = Figures(skills={"fly": SkillFigures(lasts=point(60))})
    assert chances(storm(FLIGHT, flown)) == (0, 1)
    ends = {"begin": [end("fly", "DONE", "accomplished"), end("fly", "BLOCKED", "given_up"), end("fly", "ABORTED", "given_up")]}
    assert chances(storm(ends, Figures())) == (0, 1)
    known = {"fly": SkillFigures(results={"DONE": Range(Fraction(9, 10), Fraction(95, 100)), "BLOCKED": point("0.02")}, lasts=point(60))}
    assert chances(storm(ends, Figures(skills=known))) == (Fraction(9, 10), Fraction(95, 100))
    # What is left out has the rest: here nothing.
    known = {"fly": SkillFigures(results={"DONE": point("0.98"), "BLOCKED": point("0.02")}, lasts=point(60))}
    assert chances(storm(ends, Figures(skills=known))) == (Fraction(98, 100),) * 2


def test_a_rate_between_two_bounds_gives_a_chance_between_two() -> None:
    figures = Figures({"motor": FaultFigures(rate=Range(Fraction(1, 3600), Fraction(1, 600)))}, {"fly": SkillFigures(lasts=point(60))})
    assert chances(storm(FLIGHT, figures)) == (Fraction(10, 11), Fraction(60, 61))


def test_what_ends_some_time_is_not_waited_for_for_ever_and_a_fault_that_may_not_come_is() -> None:
    assert chances(storm({"begin": [end("fly", "DONE", "accomplished")]}, Figures())) == (1, 1)
    assert chances(storm({"begin": [fault("motor", "accomplished")]}, Figures())) == (0, 1)
    assert chances(storm({"begin": [Step(Kind.ANY, "pilot", "accomplished")]}, Figures())) == (0, 1)
    assert storm({"begin": [fault("motor", "accomplished")]}, Figures()).seconds(most=True) is None


def test_the_software_comes_before_what_takes_time() -> None:
    table = {"begin": [now("accomplished"), now("given_up"), fault("motor", "degraded")]}
    asked = storm(table, Figures())
    assert chances(asked) == (0, 1)
    assert chances(asked, Outcome.DEGRADED) == (0, 0)


def test_a_fault_that_lasts_is_mended() -> None:
    table = {
        "begin": [end("fly", "DONE", "accomplished"), fault("motor", "out")],
        "out": [Step(Kind.MENDED, "motor", "begin"), fault("pilot", "given_up")],
    }
    faults = {"motor": FaultFigures(rate=point("1/60"), lasts=point(10)), "pilot": FaultFigures(rate=point("1/10"))}
    figures = Figures(faults, {"fly": SkillFigures(lasts=point(60))})
    # From begin: half of it done, half out; from out half back: x = 1/2 + 1/2 * 1/2 x.
    assert chances(storm(table, figures)) == (Fraction(2, 3),) * 2
    for lasts in (None, ANY_RATE):
        low, _ = chances(storm(table, figures.with_fault("motor", lasts=lasts)))
        assert low == Fraction(1, 2)


def test_what_was_not_looked_at_widens_the_bounds() -> None:
    table = {"begin": [end("fly", "DONE", "later"), end("fly", "BLOCKED", "given_up")], "later": [now("accomplished")]}
    figures = Figures(skills={"fly": SkillFigures(results={"DONE": point("0.9"), "BLOCKED": point("0.1")}, lasts=point(1))})
    asked = Storm(quantify(explore(Table(table), most=1), figures))
    assert chances(asked) == (0, 1)
    assert chances(Storm(quantify(explore(Table(table)), figures))) == (Fraction(9, 10),) * 2


def test_corners_of_likelihoods() -> None:
    assert set(corners([ANY_CHANCE] * 3)) == {(1, 0, 0), (0, 1, 0), (0, 0, 1)}
    assert corners([point("0.5"), point("0.4")]) == []
    assert set(corners([Range(Fraction(1, 2), Fraction(3, 4)), ANY_CHANCE])) == {
        (Fraction(1, 2), Fraction(1, 2)),
        (Fraction(3, 4), Fraction(1, 4)),
    }


# --- chance -------------------------------------------------------------------------------------------------------------

SIZE = 6


@st.composite
def chains(draw: st.DrawFn) -> list[list[int]]:
    """Draw the weights of the next states, of which the last two are ends."""
    rows = []
    for state in range(SIZE - 2):
        weights = draw(st.lists(st.integers(0, 5), min_size=SIZE, max_size=SIZE))
        weights[state + 1] += 1
        rows.append(weights)
    return rows


@settings(max_examples=60, deadline=None)
@given(chains(), st.booleans())
def test_odds_of_chains_are_the_solution_of_their_equations(rows: list[list[int]], exact: bool) -> None:  # noqa: FBT001
    matrix = np.array(rows, dtype=float)
    matrix /= matrix.sum(axis=1, keepdims=True)
    inner = matrix[:, : SIZE - 2]
    solved = np.linalg.solve(np.eye(SIZE - 2) - inner, matrix[:, SIZE - 2])
    choices = tuple((Choice({to: Fraction(weight, sum(row)) for to, weight in enumerate(row) if weight}),) for row in rows)
    outcomes = (*(None for _ in rows), ACCOMPLISHED, GIVEN_UP)
    found = Storm(Process((*choices, (), ()), outcomes), exact=exact).chance([ACCOMPLISHED], most=False).number
    assert float(found.low) - 1e-12 <= solved[0] <= float(found.high) + 1e-12
    assert found.value == pytest.approx(solved[0], abs=1e-8)


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_the_least_is_below_the_greatest_and_worse_faults_lower_both(data: st.DataObject) -> None:
    """Begin, three legs with a fault that gives up, choices of the software between two ways on."""
    legs = ["begin", "second", "third", "accomplished"]
    table = {
        here: [end(f"leg {data.draw(st.integers(0, 1))}", "DONE", there), end("other", "LOST", "given_up"), fault("motor", "given_up")]
        for here, there in itertools.pairwise(legs)
    }
    table["second"] = [now("third"), now("third, the long way")]
    table["third, the long way"] = [end("detour", "DONE", "third"), fault("motor", "given_up")]
    seconds = st.integers(1, 100)
    skills = {name: SkillFigures(lasts=point(data.draw(seconds))) for name in ("leg 0", "leg 1", "detour")}
    skills["other"] = SkillFigures(fails={"LOST": point(Fraction(1, data.draw(st.integers(50, 1000))))})
    before: tuple[Fraction, Fraction] = (Fraction(1), Fraction(1))
    for mean_s in sorted(data.draw(st.sets(st.integers(10, 10_000), min_size=2, max_size=3)), reverse=True):
        low, high = chances(storm(table, Figures({"motor": FaultFigures(rate=point(Fraction(1, mean_s)))}, skills)))
        assert low <= high
        assert low < before[0]
        assert high < before[1]
        before = (low, high)
