"""Reads a campaign: which scenarios, seeds, faults and times, listed or drawn. The same file gives the same flights."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from alula_common.faults import FaultError, FaultRequest, parse_fault
from alula_common.located_yaml import Located, choices, read_yaml
from alula_common.scenarios import scenario_names
from run_analysis.errors import AnalysisError

KEYS = ("about", "over", "scenarios", "seeds", "faults", "flights", "seed", "draw", "behaviour", "at_once")
DRAW = ("faults", "most", "at_s", "lasts_s")
MOCKS, SIMULATOR = "mocks", "simulator"
MOST_FLIGHTS = 1_000_000


@dataclass(frozen=True)
class Flight:
    """One flight of a campaign; ``faults`` as on the command line of ``fly``."""

    number: int
    scenario: str
    seed: int
    faults: tuple[str, ...]

    @property
    def requests(self) -> list[FaultRequest]:
        """The faults as values."""
        return [parse_fault(text) for text in self.faults]


@dataclass(frozen=True)
class Campaign:
    """Flights, numbered from 0, and over what they are flown; ``at_once`` is how many at a time, None: one a core."""

    over: str
    flights: tuple[Flight, ...]
    behaviour: tuple[Path, ...] = ()
    at_once: int | None = None
    scenarios: tuple[str, ...] = field(default=())

    def as_dict(self) -> dict[str, object]:
        """Return what decides the table: a campaign goes on only where this is the same."""
        flights = [asdict(flight) for flight in self.flights]
        return {"over": self.over, "behaviour": [path.read_text(encoding="utf-8") for path in self.behaviour], "flights": flights}


def load_campaign(path: Path) -> Campaign:
    """Read a file.

    Raises:
        AnalysisError: it can't be read or is wrong; the message names file and line.
    """
    document = read_yaml(path, AnalysisError)
    if document is None:
        raise AnalysisError(f"{path}: is empty; a campaign may have {', '.join(KEYS)}")
    said = document.record("a campaign", KEYS)
    for wanted, other in (("flights", "faults"), ("draw", "faults"), ("draw", "seeds"), ("flights", "seeds")):
        if wanted in said and other in said:
            raise said[other].wrong(f"`{other}` lists flights, `{wanted}` draws them; write one of both")
    over = _choice(said["over"], (MOCKS, SIMULATOR)) if "over" in said else MOCKS
    scenarios = tuple(_choice(part, scenario_names()) for part in said["scenarios"].elements()) if "scenarios" in said else ("mapping",)
    drawn = "draw" in said or "flights" in said
    flights = _drawn(document, said, scenarios) if drawn else _listed(said, scenarios)
    if over == SIMULATOR and "behaviour" in said:
        raise said["behaviour"].wrong("`behaviour` says what mocks do; the simulator has none")
    return Campaign(
        over=over,
        flights=tuple(flights),
        behaviour=tuple(_file(path, part) for part in said["behaviour"].elements()) if "behaviour" in said else (),
        at_once=_whole(said["at_once"], "`at_once`", 1, 64) if "at_once" in said else (1 if over == SIMULATOR else None),
        scenarios=scenarios,
    )


def _choice(part: Located, known: Sequence[str]) -> str:
    word = part.text("a name")
    if word not in known:
        raise part.wrong(f"there is no `{word}`; there are {choices(word, known)}")
    return word


def _whole(part: Located, what: str, low: int, high: int) -> int:
    number = part.number(what, low, high)
    if number != int(number):
        raise part.wrong(f"{what} should be a whole number, not {number:g}")
    return int(number)


def _file(path: Path, part: Located) -> Path:
    file = path.parent / part.text("a behaviour file")
    if not file.is_file():
        raise part.wrong(f"there is no file {file}")
    return file


# --- listed -------------------------------------------------------------------------------------------------------------


def _listed(said: dict[str, Located], scenarios: Sequence[str]) -> list[Flight]:
    seeds = [_whole(part, "a seed", 0, 2**31 - 1) for part in said["seeds"].elements()] if "seeds" in said else [0]
    faults = [tuple(_fault(one) for one in part.elements()) for part in said["faults"].elements()] if "faults" in said else [()]
    every = itertools.product(scenarios, seeds, faults)
    return [Flight(number, *one) for number, one in enumerate(every)]


def _fault(part: Located) -> str:
    try:
        return str(parse_fault(part.text("a fault")))
    except FaultError as error:
        raise part.wrong(str(error)) from None


# --- drawn --------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Draw:
    """What is drawn for a flight: up to ``most`` of its scenario's faults, each in this span of time, lasting this long or for good."""

    faults: Mapping[str, tuple[str, ...]]
    most: int
    at_s: tuple[float, float]
    lasts_s: tuple[float, float] | None

    def flight(self, scenario: str, chance: random.Random) -> tuple[str, ...]:
        """Draw the faults of one flight: none, one or several, in the order of time."""
        names = self.faults[scenario]
        several = [self._one(names, chance) for _ in range(chance.randint(0, self.most))]
        return tuple(str(fault) for fault in sorted(several, key=lambda fault: (fault.begin_s or 0.0, fault.what)))

    def _one(self, names: Sequence[str], chance: random.Random) -> FaultRequest:
        what, _, how = chance.choice(names).partition(":")
        begin_s = round(chance.uniform(*self.at_s), 1)
        ends = self.lasts_s is not None and chance.random() < 0.5
        return FaultRequest(what, how, begin_s, round(begin_s + chance.uniform(*self.lasts_s), 1) if ends and self.lasts_s else None)


def _drawn(document: Located, said: dict[str, Located], scenarios: Sequence[str]) -> Iterator[Flight]:
    for key in ("flights", "draw"):
        if key not in said:
            raise document.wrong(f"a campaign that draws needs `{key}`")
    count = _whole(said["flights"], "`flights`", 1, MOST_FLIGHTS)
    seed = _whole(said["seed"], "`seed`", 0, 2**31 - 1) if "seed" in said else 0
    draw = _draw(said["draw"], scenarios)
    for number in range(count):
        # One generator a flight: another number of flights leaves the first ones as they were.
        chance = random.Random(f"{seed} {number}")  # noqa: S311 - nothing here is secret
        scenario = scenarios[number % len(scenarios)]
        yield Flight(number, scenario, chance.randrange(2**31), draw.flight(scenario, chance))


def _draw(part: Located, scenarios: Sequence[str]) -> _Draw:
    said = part.record("`draw`", DRAW)
    if "faults" not in said:
        raise part.wrong("`draw` needs `faults`: the names of which it draws")
    return _Draw(
        faults=_names(said["faults"], scenarios),
        most=_whole(said["most"], "`most`", 0, 100) if "most" in said else 1,
        at_s=_span(said["at_s"], "`at_s`") if "at_s" in said else (0.0, 90.0),
        lasts_s=_span(said["lasts_s"], "`lasts_s`") if "lasts_s" in said else None,
    )


def _names(part: Located, scenarios: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Return the faults to draw from by scenario: a list is for all of them."""
    given = part.record("`faults`", scenarios) if part.is_mapping else dict.fromkeys(scenarios, part)
    for scenario in scenarios:
        if scenario not in given:
            raise part.wrong(f"`faults` says nothing of {scenario}")
    return {scenario: tuple(_timeless(one) for one in given[scenario].elements()) for scenario in scenarios}


def _timeless(part: Located) -> str:
    name = _fault(part)
    if "@" in name:
        raise part.wrong(f"`{name}` has a time; times are drawn, from `at_s`")
    return name


def _span(part: Located, what: str) -> tuple[float, float]:
    numbers = [one.number(what, 0.0, 1e5) for one in part.elements()]
    if len(numbers) != 2 or numbers[0] > numbers[1]:
        raise part.wrong(f"{what} should be [from, to] in seconds")
    return numbers[0], numbers[1]
