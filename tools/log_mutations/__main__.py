"""Prints how surely altered logs are told from good ones: ``setup/in_ros2 python -m log_mutations [--flights N] [--each N] [--seed N]``."""

from __future__ import annotations

import argparse
import random
import sys
from collections.abc import Iterator

from alula.campaign.mocked_scenarios import load_mocked_scenario
from alula.common.faults import FaultRequest
from alula.model.conditions import data_of
from alula.model.deadlines import waits
from alula.model.model import Skillset
from alula.runtime.core.events import EngineEvent
from log_mutations.counting import conforms, count, table

SCENARIOS = ("mapping", "inspection")
LONGEST_S = 90.0


def good_logs(flights: int, chance: random.Random) -> Iterator[tuple[Skillset, list[EngineEvent]]]:
    """Yield the log of each skillset of flights with a random fault each, one that has anything in it."""
    scenarios = [load_mocked_scenario(name) for name in SCENARIOS]
    for number in range(flights):
        scenario = scenarios[number % len(scenarios)]
        fault = FaultRequest(chance.choice(sorted(scenario.behaviour.faults)), begin_s=chance.uniform(0.0, LONGEST_S))
        flown = scenario.run([fault], seed=number)
        for skillset in scenario.skillsets:
            events = [event for event in flown.events if event.skillset == skillset.name]
            if len(events) > 1 and not asks_data(skillset):
                yield skillset, events


def asks_data(skillset: Skillset) -> bool:
    """Return whether data or durations decide anything: to prove that such a log is legal, an engine would need their values."""
    invariants = [one for skill in skillset.skills for one in skill.invariants]
    asked = [one.condition for skill in skillset.skills for one in skill.preconditions] + [one.condition for one in invariants]
    return any(map(data_of, asked)) or any(map(waits, invariants))


def main() -> int:
    """Count, print, and end with 1 where a good log has alarmed or a spoiled one was missed."""
    parser = argparse.ArgumentParser(prog="log_mutations", description="Count how many corrupted logs the conformance check recognises.")
    parser.add_argument("--flights", type=int, default=100, help="good flights over mocks (default 100)")
    parser.add_argument("--each", type=int, default=50, help="corrupted logs of each kind (default 50)")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    chance = random.Random(given.seed)  # noqa: S311 - nothing here is secret
    logs = list(good_logs(given.flights, chance))
    alarms = sum(not conforms(*log) for log in logs)
    counts = count(logs, given.each, chance)
    sys.stdout.write(f"{len(logs)} good logs of {given.flights} flights, false alarms: {alarms}\n\n{table(counts)}\n")
    return 1 if alarms or any(one.missed for one in counts.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
