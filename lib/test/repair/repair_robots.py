"""Small random robots, and missions of theirs that fail when a sensor does: what a repair is asked for."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

FAULTS = "f"
EYES = "eyes"
BODY = "body"


@dataclass(frozen=True)
class Skills:
    """What a robot can do, by name.

    Attributes:
        sensors: how many; sensor number k is ``eyes.s<k>``, and its fault ``f<k>``.
        watching: skills that run until their sensor fails.
        acting: skills that come to an end, each with its inputs as XML has them.
        models: the text of the skillsets.
    """

    sensors: int
    watching: tuple[str, ...]
    acting: tuple[tuple[str, str], ...]
    models: str


def skills_of(chance: random.Random) -> Skills:
    """Return skills of a random robot."""
    sensors, drives = chance.randint(1, 3), chance.randint(1, 3)
    watching = [(f"watch_{number}", chance.randrange(sensors)) for number in range(chance.randint(1, 3))]
    acting = [f"drive_{number}" for number in range(drives)]
    inputs = "input { place: int32 }" if chance.random() < 0.8 else ""
    eyes = [_sensor(f"s{number}", mends=chance.random() < 0.7) for number in range(sensors)]
    eyes += [_watch(name, f"s{sensor}", chance) for name, sensor in watching]
    two = chance.random() < 0.5
    body = ["resource wheels { initial FREE  FREE -> USED  USED -> FREE }", _sensor("motor", mends=True)]
    body += ["resource head { initial FREE  FREE -> USED  USED -> FREE }"] if two else []
    body += [_drive(name, inputs, chance, head=two and chance.random() < 0.5) for name in acting]
    body += [_hold("hold_head", "")] if two else []
    body += [_taking("turn_head", "head", "", "result { success DONE: apply = release }")] if two and chance.random() < 0.7 else []
    body += [_taking("rest", "wheels", "", "result { STANDING: apply = release }")]
    models = f"skillset {EYES} {{\n{_lines(eyes)}\n}}\nskillset {BODY} {{\n{_lines(body)}\n}}\n"
    given = ' place="1"' if inputs else ""
    return Skills(sensors, tuple(name for name, _ in watching), tuple((name, given) for name in acting), models)


def robot_of(chance: random.Random, folder: Path) -> Path:
    """Write a random robot into a folder; return its mission's file."""
    skills = skills_of(chance)
    files = {
        "robot.yaml": f"name: random\nrest: {BODY}.wheels FREE\n",
        "skillsets/robot.skill": skills.models,
        "skillsets/faults.yaml": _faults(skills, chance),
        "missions/main.xml": mission_of(skills, chance),
    }
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder / "missions/main.xml"


# --- models -------------------------------------------------------------------------------------------------------------


def _lines(several: Sequence[str]) -> str:
    return "\n".join(f"  {one}" for one in several)


def _sensor(name: str, *, mends: bool) -> str:
    back = "  extern BROKEN -> OK" if mends else ""
    return f"resource {name} {{ initial OK  extern OK -> BROKEN{back} }}"


def _watch(name: str, sensor: str, chance: random.Random) -> str:
    lost = "result { failure LOST }" if chance.random() < 0.5 else ""
    sees = f"resource = ({sensor} == OK)"
    return f"skill {name} {{ progress = 0.2  precondition {{ works: {sees} }}  invariant {{ works: {sees} }} {lost} }}"


def _drive(name: str, inputs: str, chance: random.Random, *, head: bool) -> str:
    needs = chance.random() < 0.5
    also = "  motor_works: resource = (motor == OK)" if needs else ""
    keeps = "invariant { motor_works: resource = (motor == OK) violation = release }" if needs else ""
    stuck = "  failure STUCK: apply = release" if chance.random() < 0.7 else ""
    return _taking(name, "wheels", also, f"{inputs} {keeps} result {{ success DONE: apply = release{stuck} }}", head=head)


def _hold(name: str, also: str) -> str:
    return _taking(name, "head", also, "")


def _taking(name: str, resource: str, also: str, rest: str, *, head: bool = False) -> str:
    take, release = f"{resource} -> USED", f"{resource} -> FREE"
    if head:
        take, release = f"{take}  head -> USED", f"{release}  head -> FREE"
    effects = f"effect {{ take {{ {take} }}  release {{ {release} }} }}"
    free = f"precondition {{ free: resource = ({resource} == FREE{' and head == FREE' if head else ''}){also} success take }}"
    return f"skill {name} {{ progress = 0.2 {effects} {free} interrupt {{ apply = release }} {rest} }}"


def _faults(skills: Skills, chance: random.Random) -> str:
    lines = [f"  {FAULTS}{number}: {{states: {{{EYES}.s{number}: BROKEN}}}}" for number in range(skills.sensors)]
    lines.append(f"  motor: {{states: {{{BODY}.motor: BROKEN}}}}")
    stuck = [name for name, _ in skills.acting if "STUCK" in skills.models.partition(f"skill {name} ")[2].partition("\n")[0]]
    lines += [f"  stuck: {{ends: {{{BODY}.{chance.choice(stuck)}: STUCK}}}}"] if stuck else []
    return "faults:\n" + "\n".join(lines) + "\n"


# --- missions -----------------------------------------------------------------------------------------------------------


def mission_of(skills: Skills, chance: random.Random) -> str:
    """Return a random mission of a robot, which drives somewhere, often beside what watches."""
    legs = "".join(_leg(skills, chance, number) for number in range(chance.randint(1, 2)))
    work = f'<Sequence name="legs">{legs}</Sequence>'
    if chance.random() < 0.8:
        name = chance.choice(skills.watching)
        wait = f'<WaitFor name="it sees" if="progress({EYES}.{name}) &gt;= 1"/>' if chance.random() < 0.7 else ""
        seen = f'<{EYES}.{name} name="look ahead"/>{_other(skills, chance)}<Sequence name="when it sees">{wait}{work}</Sequence>'
        work = f'<Parallel name="drive with eyes" success_count="1" failure_count="1">{seen}</Parallel>'
    work = _around(work, chance)
    separate = chance.random() < 0.5
    use = '<SubTree ID="work" name="the work" _autoremap="true"/>' if separate else work
    tree = f'<BehaviorTree ID="work">{work}</BehaviorTree>' if separate else ""
    rests = chance.random() < 0.8
    stop = f'<BehaviorTree ID="stop_here"><{BODY}.rest name="rest"/></BehaviorTree>' if rests else ""
    end = _end(rests=rests, chance=chance)
    top = f'<Fallback name="mission"{_wanted(skills, chance)}>{use}{end}</Fallback>'
    main = f'<BehaviorTree ID="main">{top}</BehaviorTree>'
    return f'<root BTCPP_format="4" main_tree_to_execute="main">\n{main}\n{tree}\n{stop}\n</root>\n'


def _leg(skills: Skills, chance: random.Random, number: int) -> str:
    name, given = chance.choice(skills.acting)
    return f'<{BODY}.{name} name="leg {number}"{given}/>'


def _other(skills: Skills, chance: random.Random) -> str:
    return f'<{EYES}.{chance.choice(skills.watching)} name="look too"/>' if chance.random() < 0.2 else ""


def _around(work: str, chance: random.Random) -> str:
    kind = chance.random()
    if kind < 0.2:
        return f'<RetryUntilSuccessful name="twice" num_attempts="2">{work}</RetryUntilSuccessful>'
    if kind < 0.35:
        return f'<Sequence name="all"><Script name="begin" code="rounds := 0"/>{work}</Sequence>'
    return work


def _end(*, rests: bool, chance: random.Random) -> str:
    if rests and chance.random() < 0.4:
        return '<ForceFailure name="given up"><SubTree ID="stop_here" name="stop here"/></ForceFailure>'
    return '<AlwaysFailure name="given up"/>' if chance.random() < 0.7 else ""


def _wanted(skills: Skills, chance: random.Random) -> str:
    """Return properties, of which some hold and some don't."""
    drive, _ = chance.choice(skills.acting)
    watch = chance.choice(skills.watching)
    blind = f"{EYES}.s{chance.randrange(skills.sensors)} == BROKEN"
    several = (
        f"property apart: never {BODY}.{drive} running and {EYES}.{watch} running;",
        f"property motor: never {BODY}.{drive} running and {BODY}.motor == BROKEN;",
        f"property head: never {BODY}.{drive} running and {BODY}.wheels == FREE;",
        f"property blind: never {EYES}.{watch} running and {blind};",
    )
    wanted = [one for one in several if chance.random() < 0.3]
    return f' _description="{" ".join(wanted)}"' if wanted else ""
