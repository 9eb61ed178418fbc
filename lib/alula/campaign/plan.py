"""Reads a campaign: which scenarios, seeds, faults and times, listed or drawn. The same file gives the same runs."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from alula.campaign.drawing import MAX_SEED, Draw, Kind, Kinds
from alula.common.faults import FaultError, FaultRequest, parse_fault
from alula.common.keys import Key
from alula.common.located_yaml import Located, choices, read_yaml
from alula.common.scenarios import mission_names
from alula.records.errors import AnalysisError

KEYS: Mapping[str, Key] = {
    "about": Key("a sentence"),
    "over": Key("`mocks`, or `simulator`: live runs, whose folders stay", "`mocks`"),
    "scenarios": Key("one that is named twice is run twice as often", "all that have a mission"),
    "seeds": Key("with `faults`: every scenario with every seed and every list", "`[0]`"),
    "faults": Key("lists of faults as of `--fail`: `[[], [battery@30], [battery@30, door@50]]`", "`[[]]`"),
    "runs": Key("how many are drawn, instead of `seeds` and `faults`"),
    "seed": Key("of the drawing", "0"),
    "draw": Key("what is drawn for each run: below"),
    "worlds": Key("live: a world file by scenario, `{patrol: FILE}`", "the scenario's"),
    "options": Key("live: the robot's own options, as `{rate: 0}` (`alula run --options`)"),
    "limit_s": Key("live: ends a run that hangs, seconds of mission clock", "no limit"),
    "behaviour": Key("behaviour files on top of the robot's own mocks"),
    "at_once": Key("how many runs at a time", "one a core; live: 1"),
}
DRAW: Mapping[str, Key] = {
    "faults": Key(
        "entries to draw from, for all scenarios or by scenario. An entry is a fault, or a list of kinds of which one is drawn: "
        '`[door:stuck, door:slow, {"door:shut": 5}]` (shut for 5 s); a thing is in one entry only',
        "`in_turn`",
    ),
    "least": Key("number of faults a run, at least", "0"),
    "most": Key("and at most, each of another entry", "1"),
    "in_turn": Key("instead: the runs of a scenario take its lists one after another, as `{patrol: [[], [battery], [battery, door]]}`"),
    "at_s": Key("when, in seconds after the departure", "`[0, 90]`"),
    "lasts_s": Key("half of them end again after so long", "none ends"),
}
MOCKS, SIMULATOR = "mocks", "simulator"
MOST_RUNS = 1_000_000


@dataclass(frozen=True)
class PlannedRun:
    """One run of a campaign; ``faults`` as on the command line of ``run``; ``world`` is a file, None: the scenario's own."""

    number: int
    scenario: str
    seed: int
    faults: tuple[str, ...]
    world: Path | None = None

    @property
    def requests(self) -> list[FaultRequest]:
        """The faults of the run, parsed; raises FaultError where a text is none."""
        return [parse_fault(text) for text in self.faults]


@dataclass(frozen=True)
class Campaign:
    """A campaign: its runs, numbered from 0, and what they run over.

    ``options`` are the robot's own of a live run, by name, and ``limit_s`` is how long one may last, seconds of mission clock, 0: without a
    limit; ``at_once`` is how many at a time, None: one a core.
    """

    over: str
    runs: tuple[PlannedRun, ...]
    options: Mapping[str, str] = field(default_factory=dict)
    limit_s: float = 0.0
    behaviour: tuple[Path, ...] = ()
    at_once: int | None = None
    scenarios: tuple[str, ...] = field(default=())

    def as_dict(self) -> dict[str, object]:
        """Return all that determines the table: a campaign is continued only where this has not changed."""
        runs = [{**asdict(planned), "world": planned.world and planned.world.read_text(encoding="utf-8")} for planned in self.runs]
        return {
            "over": self.over,
            "behaviour": [path.read_text(encoding="utf-8") for path in self.behaviour],
            "runs": runs,
            **({"options": dict(self.options)} if self.options else {}),
            **({"limit_s": self.limit_s} if self.limit_s else {}),
        }


def load_campaign(path: Path) -> Campaign:
    """Read a file.

    Raises:
        AnalysisError: it can't be read or is wrong; the message names file and line.
    """
    document = read_yaml(path, AnalysisError)
    if document is None:
        raise AnalysisError(f"{path}: is empty; a campaign may have {', '.join(KEYS)}")
    said = document.record("a campaign", KEYS)
    for wanted, other in (("runs", "faults"), ("draw", "faults"), ("draw", "seeds"), ("runs", "seeds")):
        if wanted in said and other in said:
            raise said[other].wrong(f"`{other}` lists runs, `{wanted}` draws them; use only one of both")
    over = _choice(said["over"], (MOCKS, SIMULATOR)) if "over" in said else MOCKS
    missions = mission_names()
    scenarios = tuple(_choice(part, missions) for part in said["scenarios"].elements()) if "scenarios" in said else tuple(missions)
    drawn = "draw" in said or "runs" in said
    for key in ("scenarios", "seeds", "faults"):
        if key in said and not said[key].elements():
            raise said[key].wrong(f"`{key}` is empty, so there would be no run; leave it out, or name one")
    runs = _drawn(document, said, scenarios) if drawn else _listed(said, scenarios)
    if over == SIMULATOR and "behaviour" in said:
        raise said["behaviour"].wrong("`behaviour` is for mocks only; leave it out, or do it `over: mocks`")
    for key in ("worlds", "options", "limit_s"):
        if over == MOCKS and key in said:
            raise said[key].wrong(f"`{key}` is for the simulator only; leave it out, or do it `over: simulator`")
    worlds = said["worlds"].record("`worlds`", scenarios) if "worlds" in said else {}
    files = {scenario: _file(path, part, "a world file") for scenario, part in worlds.items()}
    return Campaign(
        over=over,
        runs=tuple(replace(planned, world=files.get(planned.scenario)) for planned in runs),
        options={name: one.text(f"the option `{name}`") for name, one in said["options"].entries("`options`").items()}
        if "options" in said
        else {},
        limit_s=said["limit_s"].number("`limit_s`", 1.0, 1e5) if "limit_s" in said else 0.0,
        behaviour=tuple(_file(path, part, "a behaviour file") for part in said["behaviour"].elements()) if "behaviour" in said else (),
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


def _file(path: Path, part: Located, what: str) -> Path:
    file = path.parent / part.text(what)
    if not file.is_file():
        raise part.wrong(f"there is no file {file}")
    return file


# --- listed -------------------------------------------------------------------------------------------------------------


def _listed(said: dict[str, Located], scenarios: Sequence[str]) -> list[PlannedRun]:
    seeds = [_whole(part, "a seed", 0, MAX_SEED) for part in said["seeds"].elements()] if "seeds" in said else [0]
    lists = [part.elements() for part in said["faults"].elements()] if "faults" in said else [[]]
    faults = [tuple(_fault(one, one.text("a fault")) for one in several) for several in lists]
    every = itertools.product(scenarios, seeds, faults)
    return [PlannedRun(number, *one) for number, one in enumerate(every)]


def _fault(part: Located, text: str) -> str:
    try:
        return str(parse_fault(text))
    except FaultError as error:
        raise part.wrong(str(error)) from None


# --- drawn --------------------------------------------------------------------------------------------------------------


def _drawn(document: Located, said: dict[str, Located], scenarios: Sequence[str]) -> list[PlannedRun]:
    for key in ("runs", "draw"):
        if key not in said:
            raise document.wrong(f"a campaign that draws needs `{key}`")
    count = _whole(said["runs"], "`runs`", 1, MOST_RUNS)
    seed = _whole(said["seed"], "`seed`", 0, MAX_SEED) if "seed" in said else 0
    drawn = _draw(said["draw"], scenarios).runs(scenarios, count, seed)
    return [PlannedRun(one.number, one.scenario, one.seed, tuple(map(str, one.faults))) for one in drawn]


def _draw(part: Located, scenarios: Sequence[str]) -> Draw:
    said = part.record("`draw`", DRAW)
    if ("faults" in said) == ("in_turn" in said):
        raise part.wrong("`draw` needs `faults` to draw from, or `in_turn`: lists of faults, which the runs use one after another")
    for key in ("least", "most"):
        if "in_turn" in said and key in said:
            raise said[key].wrong(f"`{key}` says how many of `faults` are drawn; `in_turn` draws none")
    least = _whole(said["least"], "`least`", 0, 100) if "least" in said else 0
    most = _whole(said["most"], "`most`", least, 100) if "most" in said else max(1, least)
    faults, in_turn = (_by_scenario(said[key], key, scenarios) if key in said else {} for key in ("faults", "in_turn"))
    lists = {scenario: [_kinds(one) for one in part.elements()] for scenario, part in in_turn.items()}
    for scenario, one in lists.items():
        if not one:
            raise in_turn[scenario].wrong(f"`in_turn` has no list for {scenario}; `[[]]` means runs without faults")
    return Draw(
        faults={scenario: _entries(scenario, part, most) for scenario, part in faults.items()},
        in_turn=lists,
        least=least,
        most=most,
        at_s=_span(said["at_s"], "`at_s`") if "at_s" in said else (0.0, 90.0),
        lasts_s=_span(said["lasts_s"], "`lasts_s`") if "lasts_s" in said else None,
    )


def _entries(scenario: str, part: Located, most: int) -> list[Kinds]:
    """Read the entries to draw from: a run takes each at most once, so none of the things that fail is in two of them."""
    found: list[Kinds] = []
    known: set[str] = set()
    for element in part.elements():
        kinds = _kinds(element)
        if not kinds:
            raise element.wrong("an entry of `faults` has no fault; name one, or leave it out")
        for what in sorted({kind.what for kind in kinds}):
            if what in known:
                raise element.wrong(f"`{what}` is in two entries, and could be drawn twice for a run; put its ways into one list")
        known.update(kind.what for kind in kinds)
        found.append(kinds)
    if not found:
        raise part.wrong(f"`faults` has no fault to draw for {scenario}; for runs without faults write `in_turn: [[]]`")
    if most > len(found):
        raise part.wrong(f"up to {most} of `faults` are to be drawn for {scenario}, and there are {len(found)} entries")
    return found


def _by_scenario(part: Located, key: str, scenarios: Sequence[str]) -> dict[str, Located]:
    """Return the faults to draw from by scenario: a list is for all of them."""
    given = part.record(f"`{key}`", scenarios) if part.is_mapping else dict.fromkeys(scenarios, part)
    for scenario in scenarios:
        if scenario not in given:
            raise part.wrong(f"`{key}` has no entry for {scenario}")
    return given


def _kinds(part: Located) -> Kinds:
    """Read a fault, or a list of them."""
    return [_kind(one) for one in part.elements()]


def _kind(part: Located) -> Kind:
    """Read ``radio:out``, or ``{radio:out: 5}`` for a fault that lasts 5 s."""
    if not part.is_mapping:
        return _timeless(part, part.text("a fault"))
    entries = list(part.entries("a fault").items())
    if len(entries) != 1:
        raise part.wrong("a fault with its time is `{NAME: SECONDS}`")
    ((name, lasts),) = entries
    return _timeless(part, name, lasts.number("how long a fault lasts", 0.1, 1e5))


def _timeless(part: Located, text: str, lasts_s: float | None = None) -> Kind:
    name = _fault(part, text)
    if "@" in name:
        raise part.wrong(f"`{name}` has a time; times are drawn, from `at_s`")
    what, _, how = name.partition(":")
    return Kind(what, how, lasts_s)


def _span(part: Located, what: str) -> tuple[float, float]:
    numbers = [one.number(what, 0.0, 1e5) for one in part.elements()]
    if len(numbers) != 2 or numbers[0] > numbers[1]:
        raise part.wrong(f"{what} should be [from, to] in seconds")
    return numbers[0], numbers[1]
