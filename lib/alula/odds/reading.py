"""Reads the figures of ``faults.yaml``: how often faults come, how long they last, how skills end; each with where it comes from.

    faults:
      zed:
        happens: [1 per 500 h, 0.2 % at departure]       # also `1 to 3 per 1000 h`, `0.01 per use of video.stream`, `never`
        lasts: 30 s                                     # also `10 to 60 s`, `for ever`
        source: maker's data sheet, table 3
    transitions:                                        # of the functional layer, that are nobody's fault
      navigation.homepoint_status INVALID: {happens: never, source: "an autopilot that has a home keeps it"}
    skills:
      navigation.goto:
        results: {ARRIVED: 0.97, BLOCKED: 1 to 3 %}     # when it ends by itself
        lasts: 12 s
        fails: {ABORTED: 1 per 200 h}                   # while it runs
        progress: 0.3 s                                 # until its progress is what the mission waits for
        source: flights of 2025

Figures of results stand here, and not in the models or with the mocks: a model says what may happen on any vehicle, mocks play what
a test wants to see, and these are measured on one robot, as the figures of its faults are.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from fractions import Fraction
from pathlib import Path

from alula.common.located_yaml import Located, choices, read_yaml
from alula.model.execution_state import ExecutionState
from alula.model.model import Skill, Skillset
from alula.odds.errors import OddsError
from alula.odds.figures import ANY_RATE, NEVER, FaultFigures, Figures, Range, SkillFigures, corners
from alula.odds.system import DEPARTURE
from alula.records.causes.fault_file import EFFECTS, FIGURES, ODDS, PARTS, SECTIONS, TRANSITIONS

SECONDS = {"ms": Fraction(1, 1000), "s": Fraction(1), "min": Fraction(60), "h": Fraction(3600), "d": Fraction(86400)}
OF_SKILL = ("results", "lasts", "fails", "progress", "source")
OTHER_ENDS = (ExecutionState.FAILED.value, ExecutionState.NOT_VALIDATED.value)
MOST_STAGES = 100

_NUMBER = r"\d+(?:\.\d+)?(?:[eE][+-]?\d+)?"
_UNIT = "|".join(SECONDS)
_RANGE = rf"(?P<low>{_NUMBER})(?: to (?P<high>{_NUMBER}))?"
_STAGES = r"(?:, in (?P<stages>\d+) stages)?"
_RATE = re.compile(rf"{_RANGE} per (?:(?P<each>{_NUMBER}) )?(?P<unit>{_UNIT}){_STAGES}")
_TIME = re.compile(rf"{_RANGE} (?P<unit>{_UNIT}){_STAGES}")
_CHANCE = re.compile(rf"{_RANGE}(?P<percent> ?%)?(?: (?:per use of (?P<skill>\S+)|(?P<at>at departure)))?")

RATES = "as `1 per 500 h` or `1 to 3 per 1000 h`"
CHANCES = "from 0 to 1, or in %, as `0.98` or `1 to 3 %`"


def load_figures(path: Path, skillsets: Sequence[Skillset]) -> Figures:
    """Read a file and check it against the models of the robot.

    Raises:
        OddsError: the file can't be read or is wrong; the message names file, line and column.
    """
    document = read_yaml(path, OddsError, columns=True)
    sections = {} if document is None else document.record("a file of faults", SECTIONS)
    skills = {f"{one.name}.{skill.name}": skill for one in skillsets for skill in one.skills}
    faults = {}
    for section in EFFECTS:
        for name, part in sections[section].entries(f"`{section}`").items() if section in sections else ():
            faults[name] = _fault(part, name, skills)
    entered = {f"{of.name}.{one.name} {state}" for of in skillsets for one in of.resources for state in one.states}
    for name, part in sections[TRANSITIONS].entries(f"`{TRANSITIONS}`").items() if TRANSITIONS in sections else ():
        if name not in entered:
            raise part.wrong(f"there is no state `{name}` of a resource; there are {choices(name, entered)}")
        faults[name] = _fault(part, name, skills)
    known = sections[FIGURES].entries("`skills`") if FIGURES in sections else {}
    for name, part in known.items():
        if name not in skills:
            raise part.wrong(f"there is no skill `{name}`; there are {choices(name, skills)}")
    return Figures(faults, {name: _skill(part, name, skills[name]) for name, part in known.items()})


def _fault(part: Located, name: str, skills: Collection[str]) -> FaultFigures:
    said = part.record(f"`{name}`", (*PARTS, *ODDS))
    _need_source(said, name, ("happens", "lasts"))
    rate, stages, chances = ANY_RATE, 1, dict[str, Range]()
    if "happens" in said:
        rate = NEVER
        for one in said["happens"].elements():
            text = one.text("how often a fault comes")
            if match := _RATE.fullmatch(text):
                if rate != NEVER:
                    raise one.wrong(f"`{name}` has a rate already; add the two up")
                rate, stages = _rate(one, match), _stages(one, match)
            elif (match := _CHANCE.fullmatch(text)) and (match["skill"] or match["at"]):
                use = match["skill"] or DEPARTURE
                if use != DEPARTURE and use not in skills:
                    raise one.wrong(f"there is no skill `{use}`; there are {choices(use, skills)}")
                chances[use] = _chance(one, match)
            elif text != "never":
                raise one.wrong(f"`{text}` should be {RATES}, `0.01 per use of SKILL`, `0.2 % at departure`, or `never`")
    lasts, lasts_stages = _lasts(said["lasts"]) if "lasts" in said else (ANY_RATE, 1)
    return FaultFigures(rate, stages, 1, chances, lasts, lasts_stages, _source(said))


def _lasts(part: Located) -> tuple[Range | None, int]:
    if part.text("how long it lasts") == "for ever":
        return None, 1
    return _time(part)


def _skill(part: Located, name: str, skill: Skill) -> SkillFigures:
    said = part.record(f"`{name}`", OF_SKILL)
    _need_source(said, name, ("results", "lasts", "fails", "progress"))
    ends = (*(result.name for result in skill.results), *OTHER_ENDS)
    results = {end: _likelihood(one) for end, one in _ends(said, "results", name, ends).items()}
    if results and not corners([results.get(end, Range(Fraction(0), Fraction(1))) for end in ends]):
        raise said["results"].wrong(f"the likelihoods of the results of `{name}` can't add up to 1; a result that is left out has the rest")
    breaking = (*ends, *(invariant.name for invariant in skill.invariants))
    fails = {end: _failing(one) for end, one in _ends(said, "fails", name, breaking).items()}
    lasts, stages = _time(said["lasts"]) if "lasts" in said else (ANY_RATE, 1)
    progress, _ = _time(said["progress"]) if "progress" in said else (ANY_RATE, 1)
    return SkillFigures(results, lasts, stages, fails, _source(said), progress)


def _ends(said: Mapping[str, Located], key: str, name: str, ends: Collection[str]) -> Mapping[str, Located]:
    found = said[key].entries(f"`{key}`") if key in said else {}
    for end, one in found.items():
        if end not in ends:
            raise one.wrong(f"{name} has no result `{end}`; it has {choices(end, ends)}")
    return found


def _need_source(said: Mapping[str, Located], name: str, figures: Sequence[str]) -> None:
    for key in figures:
        if key in said and "source" not in said:
            raise said[key].wrong(f"`{key}` of `{name}` is a figure: say where it comes from, as `source: flights of 2025`")


def _source(said: Mapping[str, Located]) -> str:
    return said["source"].text("`source`") if "source" in said else ""


# --- numbers with units -------------------------------------------------------------------------------------------------


def _range(part: Located, match: re.Match[str]) -> Range:
    low = Fraction(match["low"])
    high = low if match["high"] is None else Fraction(match["high"])
    if high < low:
        raise part.wrong(f"`{match[0]}` goes from {match['low']} down to {match['high']}; write the smaller number first")
    return Range(low, high)


def _rate(part: Located, match: re.Match[str]) -> Range:
    per_s = SECONDS[match["unit"]] * Fraction(match["each"] or 1)
    if not per_s:
        raise part.wrong(f"`{match[0]}`: no time has no rate; write {RATES}")
    return _range(part, match).times(1 / per_s)


def _failing(part: Located) -> Range:
    text = part.text("how often it fails")
    if text == "never":
        return NEVER
    match = _RATE.fullmatch(text)
    if match is None or match["stages"]:
        raise part.wrong(f"`{text}` should be {RATES}, or `never`")
    return _rate(part, match)


def _time(part: Located) -> tuple[Range, int]:
    text = part.text("how long it lasts")
    match = _TIME.fullmatch(text)
    if match is None:
        raise part.wrong(f"`{text}` should be a time with its unit ({', '.join(SECONDS)}), as `30 s` or `10 to 60 s`")
    found = _range(part, match).times(SECONDS[match["unit"]])
    if not found.high:
        raise part.wrong(f"`{text}`: what lasts takes some time; write a time above 0")
    return found, _stages(part, match)


def _stages(part: Located, match: re.Match[str]) -> int:
    stages = int(match["stages"] or 1)
    if not 1 <= stages <= MOST_STAGES:
        raise part.wrong(f"`{match[0]}`: a time has from 1 to {MOST_STAGES} stages")
    return stages


def _likelihood(part: Located) -> Range:
    text = part.text("how likely a result is")
    match = _CHANCE.fullmatch(text)
    if match is None or match["skill"] or match["at"]:
        raise part.wrong(f"`{text}` should be a chance {CHANCES}")
    return _chance(part, match)


def _chance(part: Located, match: re.Match[str]) -> Range:
    found = _range(part, match).times(Fraction(1, 100) if match["percent"] else 1)
    if found.high is None or found.high > 1:
        raise part.wrong(f"`{match[0]}` is more than 1; write a chance {CHANCES}")
    return found
