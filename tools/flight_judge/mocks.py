"""What the mocks say of the same faults, flight by flight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from alula.campaign.mocked_scenarios import MockedScenario, load_mocked_scenario
from alula.common.faults import parse_fault
from alula.records.errors import AnalysisError


@dataclass(frozen=True)
class Mocked:
    """How the same flight ends over mocks; ``unknown``: the faults that the mocks do not have, so that the flight is another one."""

    outcome: str
    unknown: tuple[str, ...]


class Mocks:
    """Runs scenarios over mocks, each read once."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, str], MockedScenario] = {}

    def run(self, scenario: str, world: str, seed: int, faults: Sequence[str]) -> Mocked:
        """Run a flight's faults over mocks, in its world."""
        if (scenario, world) not in self._known:
            self._known[scenario, world] = load_mocked_scenario(scenario, world=world)
        mocked = self._known[scenario, world]
        requests, unknown = [], []
        for request in map(parse_fault, faults):
            try:
                mocked.check([request])
                requests.append(request)
            except AnalysisError:
                unknown.append(str(request))
        return Mocked(mocked.run(requests, seed).end.outcome.value, tuple(unknown))


def differs(row: Mapping[str, Any], mocked: Mocked) -> bool:
    """Return whether a flight ended otherwise than over mocks."""
    return bool(row["outcome"] != mocked.outcome)
