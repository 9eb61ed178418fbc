"""What is repaired: the robots' missions with a branch deleted that they have by hand, and robots whose missions grow.

- *legs*: so many skills one after the other, beside a skill that watches; another sensor can do that, too. The branch has them all.
- *sensors*: so many skills may watch instead, and a property forbids all but the last one: each is refuted first.
- *at once*: so many robots' bodies drive side by side.
- *lamps*: nothing can watch instead, and the skillset has so many other skills that run side by side: all of it is played through.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

FAULT = "blind"
"""The fault of robots that grow: it breaks the first sensor."""


@dataclass(frozen=True)
class Case:
    """A robot's mission, written into a folder.

    Attributes:
        robot: the robot's folder.
        mission: its file.
        fault: what is to be answered.
    """

    robot: Path
    mission: Path
    fault: str


# --- the robots' missions --------------------------------------------------------------------------------------------


def copied(robot: Path, folder: Path) -> None:
    """Copy a robot's missions into a folder, in which they are changed."""
    for one in (robot / "missions").glob("*.xml"):
        (folder / one.name).write_bytes(one.read_bytes())


def put(path: Path, text: str, *patterns: str) -> None:
    """Put a text into a file for what each pattern matches, which is exactly once there."""
    whole = path.read_text(encoding="utf-8")
    for pattern in patterns:
        whole, count = re.subn(pattern, lambda _: text, whole, flags=re.DOTALL)
        if count != 1:
            raise ValueError(f"{path}: {count} times there: {pattern}")
    path.write_text(whole, encoding="utf-8")


def use_of(tree: str) -> str:
    """Return a pattern of the use of a tree."""
    return rf' *<SubTree ID="{tree}"[^>]*/>\n'


def tree_of(tree: str) -> str:
    """Return a pattern of a tree, with the empty line behind it."""
    return rf' *<BehaviorTree ID="{tree}">(?:(?!</BehaviorTree>).)*</BehaviorTree>\n\n?'


def without_lidar(root: Path, folder: Path) -> Case:
    """Return the drone's mapping without the branch that flies on with the LiDAR."""
    copied(root, folder)
    put(folder / "mapping.xml", "", use_of("lidar_navigation"), tree_of("lidar_navigation"))
    return Case(root, folder / "mapping.xml", "zed")


def without_end(root: Path, folder: Path) -> Case:
    """Return the drone's mapping without the branch by which it gives up."""
    copied(root, folder)
    put(folder / "mapping.xml", "", use_of("give_up"))
    put(folder / "flying.xml", "", tree_of("give_up"))
    return Case(root, folder / "mapping.xml", "lidar")


def without_video_end(root: Path, folder: Path) -> Case:
    """Return the drone's inspection without the branch by which it lands when the telepilot's video was lost."""
    copied(root, folder)
    put(folder / "inspection.xml", "", r' *<Sequence name="the video was lost">(?:(?!</Sequence>).)*</Sequence>\n')
    return Case(root, folder / "inspection.xml", "radio")


def without_chances(root: Path, folder: Path) -> Case:
    """Return the rover's patrol that drives once only, whatever stands in its way."""
    robot = root / "examples/rover"
    copied(robot, folder)
    once = '    <base.drive_to name="drive" target="{target}" outcome="{driven}"/>\n'
    put(folder / "answers.xml", once, r'(?<=<BehaviorTree ID="drive">\n).*?(?=  </BehaviorTree>)')
    return Case(robot, folder / "patrol.xml", "person")


def without_charge(root: Path, folder: Path) -> Case:
    """Return the rover's patrol without what charges a battery that is low, and goes on."""
    robot = root / "examples/rover"
    copied(robot, folder)
    put(folder / "answers.xml", "", r' *<Sequence name="charge and go on">(?:(?!</Sequence>).)*</Sequence>\n')
    return Case(robot, folder / "patrol.xml", "battery")


def without_the_others_turn(root: Path, folder: Path) -> Case:
    """Return the mission of drone and rover without what has the rover sent to where the drone came, when it can't fly on."""
    robot = root / "examples/two_robots"
    copied(robot, folder)
    put(
        folder / "meet.xml",
        "",
        r' *<Fallback name="fly there, or as far as it goes">\n',
        r' *<Script name="not all the way"[^>]*/>\n *</Fallback>\n',
    )
    return Case(robot, folder / "meet.xml", "drone_zed")


def without_sensor(root: Path, folder: Path) -> Case:
    """Return the drone's mapping as it is, which nothing can map without the LiDAR."""
    copied(root, folder)
    return Case(root, folder / "mapping.xml", "lidar")


ROBOTS: Mapping[str, Callable[[Path, Path], Case]] = {
    "drone, zed": without_lidar,
    "drone, no end": without_end,
    "drone, lidar": without_sensor,
    "drone, radio": without_video_end,
    "rover, person": without_chances,
    "rover, battery": without_charge,
    "two robots, zed": without_the_others_turn,
}

# --- robots that grow ------------------------------------------------------------------------------------------------


def legs(count: int) -> tuple[str, str]:
    """Return the skillsets and the tree's top of a mission of so many legs."""
    return _eyes(2) + _body("body"), _mission([_drives("body", count)])


def sensors(count: int) -> tuple[str, str]:
    """Return those of a robot with so many sensors, of which only the last one may watch while it drives."""
    wrong = [f"property p{one}: never eyes.watch_{one} running and body.drive running;" for one in range(1, count - 1)]
    return _eyes(count) + _body("body"), _mission([_drives("body", 1)], " ".join(wrong))


def at_once(count: int) -> tuple[str, str]:
    """Return those of so many bodies that drive side by side."""
    names = [f"body_{one}" if one else "body" for one in range(count)]
    return _eyes(2) + "".join(map(_body, names)), _mission([_drives(one, 1) for one in names])


def lamps(count: int) -> tuple[str, str]:
    """Return those of a robot whose one sensor has so many lamps beside it."""
    several = [_taking(f"light_{one}", f"lamp_{one}", "result { success LIT: apply = release }") for one in range(count)]
    resources = [_resource(f"lamp_{one}") for one in range(count)]
    return _eyes(1, *resources, *several) + _body("body"), _mission([_drives("body", 1)])


FAMILIES: Mapping[str, tuple[Callable[[int], tuple[str, str]], Sequence[int]]] = {
    "legs": (legs, (1, 2, 4, 8)),
    "sensors": (sensors, (2, 4, 8)),
    "at once": (at_once, (1, 2, 3, 4)),
    "lamps": (lamps, (1, 4, 16, 64)),
}


def growing(family: str, size: int, folder: Path) -> Case:
    """Write a robot of a family and its mission into a folder."""
    skillsets, top = FAMILIES[family][0](size)
    stop = '<BehaviorTree ID="stop_here"><body.rest name="rest"/></BehaviorTree>'
    main = f'<BehaviorTree ID="main">{top}</BehaviorTree>'
    files = {
        "robot.yaml": "name: growing\nrest: body.wheels FREE\n",
        "skillsets/robot.skill": skillsets,
        "skillsets/faults.yaml": f"faults:\n  {FAULT}: {{states: {{eyes.s0: BROKEN}}}}\n",
        "missions/main.xml": f'<root BTCPP_format="4" main_tree_to_execute="main">\n{main}\n{stop}\n</root>\n',
    }
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return Case(folder, folder / "missions/main.xml", FAULT)


def _eyes(count: int, *besides: str) -> str:
    sensors_ = [f"resource s{one} {{ initial OK  extern OK -> BROKEN  extern BROKEN -> OK }}" for one in range(count)]
    return _skillset("eyes", *sensors_, *besides, *(_watch(one) for one in range(count)))


def _watch(number: int) -> str:
    works = f"{{ works: resource = (s{number} == OK) }}"
    return f"skill watch_{number} {{ progress = 0.2  precondition {works}  invariant {works} }}"


def _body(name: str) -> str:
    drive = "input { place: int32 }  result { success DONE: apply = release  failure STUCK: apply = release }"
    rest = _taking("rest", "wheels", "result { success STANDING: apply = release }")
    return _skillset(name, _resource("wheels"), _taking("drive", "wheels", drive), rest)


def _resource(name: str) -> str:
    return f"resource {name} {{ initial FREE  FREE -> USED  USED -> FREE }}"


def _taking(name: str, resource: str, rest: str = "") -> str:
    effects = f"effect {{ take {{ {resource} -> USED }}  release {{ {resource} -> FREE }} }}"
    free = f"precondition {{ free: resource = ({resource} == FREE)  success take }}"
    return f"skill {name} {{ progress = 0.2  {effects}  {free}  interrupt {{ apply = release }}  {rest} }}"


def _skillset(name: str, *parts: str) -> str:
    return f"skillset {name} {{\n" + "".join(f"  {one}\n" for one in parts) + "}\n"


def _drives(body: str, count: int) -> str:
    several = "".join(f'<{body}.drive name="{body} drives {one}" place="{one}"/>' for one in range(count))
    return f'<Sequence name="legs of {body}">{several}</Sequence>'


def _mission(work: Sequence[str], wanted: str = "") -> str:
    wait = '<WaitFor name="it sees" if="progress(eyes.watch_0) &gt;= 1"/>'
    together = work[0] if len(work) == 1 else f'<Parallel name="all drive" failure_count="1">{"".join(work)}</Parallel>'
    seen = f'<eyes.watch_0 name="look ahead"/><Sequence name="when it sees">{wait}{together}</Sequence>'
    parallel = f'<Parallel name="drive with eyes" success_count="1" failure_count="1">{seen}</Parallel>'
    end = '<ForceFailure name="given up"><SubTree ID="stop_here" name="stop here"/></ForceFailure>'
    described = f' _description="{wanted}"' if wanted else ""
    return f'<Fallback name="mission"{described}>{parallel}{end}</Fallback>'
