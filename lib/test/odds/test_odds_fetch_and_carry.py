"""Fetch and carry has the chances that are derived by hand, exactly."""

from __future__ import annotations

from fractions import Fraction

import pytest
from fetch_and_carry import FetchAndCarry, by_hand, figures

from alula.odds.graph import explore
from alula.odds.process import quantify
from alula.odds.storm import Storm
from alula.odds.system import Outcome


def chance(system: FetchAndCarry) -> Fraction:
    asked = Storm(quantify(explore(system), figures()))
    low, high = (asked.chance([Outcome.ACCOMPLISHED], most=most).number for most in (False, True))
    assert low == high
    assert low.exact
    return low.low


def test_once_it_is_the_product() -> None:
    assert chance(FetchAndCarry()) == Fraction("0.294") == by_hand(1)


def test_with_five_attempts() -> None:
    # 0.294 * (1 * 1.6496 + 0.6 * 1.624 + 0.27 * 1.56 + 0.108 * 1.4 + 0.0405): see by_hand. The tutorial's runs counted 0.9505.
    assert by_hand(5) == Fraction("0.294") * Fraction("3.2369") == Fraction("0.9516486")
    assert chance(FetchAndCarry(attempts=5)) == Fraction("0.9516486")


@pytest.mark.parametrize("objects", [1, 2, 5, 20])
def test_objects_are_one_after_another(objects: int) -> None:
    assert chance(FetchAndCarry(attempts=3, objects=objects)) == by_hand(3) ** objects
