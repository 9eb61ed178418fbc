"""When a value of the functional layer is too old to be believed."""

from __future__ import annotations

STALE_PERIODS = 3.0
"""A value is stale when it is older than so many of the periods that the model promises."""


def is_stale(age_ns: int, period_s: float | None) -> bool:
    """Tell whether a value of this age is stale; one without a promised period never is."""
    return period_s is not None and age_ns > STALE_PERIODS * period_s * 1e9
