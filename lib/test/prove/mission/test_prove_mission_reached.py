"""What the search reaches in a few steps, the real engine reaches: random missions, each step of the search played and compared."""

from __future__ import annotations

import random
from collections import Counter, deque
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("z3")

from test_prove_mission_runs import PART, PICKED, robots, tree, with_visit

from alula.missions.mission_file import MissionFile
from alula.prove.mission.managers import Failures
from alula.prove.mission.play import LeftError, _Player
from alula.prove.mission.run import run_of
from alula.prove.mission.state import Event, State
from alula.prove.mission.system import System
from alula.trees.node import Node
from alula.trees.status import RUNNING

STEPS = 10
"""Two ticks, in which the mission begins and its first script is run, and eight more steps."""
MOST = 60
"""Runs that are played of a mission."""
EXACT = 100
"""Attempts and rounds are counted exactly up to so many."""

COMPUTED = "`tries`"
NEVER = '<ForceSuccess _skipIf="true"><drone.hover/></ForceSuccess>'
"""So that each mission has the leaf that scripts ask for."""


STOP = """
  <BehaviorTree ID="stop_here">
    <Fallback><drone.land name="land at once"/><drone.hover name="stay"/></Fallback>
  </BehaviorTree>
"""


def mission(chance: random.Random, folder: Path) -> Path:
    """Write a random mission that begins with its tree at once."""
    path = folder / "mission.xml"
    path.write_text(with_visit(f"""<Sequence><Script code="tries := 0; last := ''"/>{PICKED}{NEVER}{tree(chance, 2)}</Sequence>"""))
    return path


def ways(system: System, steps: int) -> Iterator[list[tuple[Event, State]]]:
    """Yield runs that together come to every situation that so many steps lead to: each goes on as far as there is something new."""
    first = system.initial()
    before: dict[State, tuple[State, Event, int] | None] = {first: None}
    depth = {first: 0}
    goes_on: set[State] = set()
    todo = deque([first])
    while todo:
        state = todo.popleft()
        if depth[state] == steps:
            continue
        for event, after in system.steps(state):
            if after not in depth:
                depth[after] = depth[state] + 1
                before[after] = (state, event, depth[after])
                goes_on.add(state)
                todo.append(after)
    for last in (state for state in depth if state not in goes_on):
        run: list[tuple[Event, State]] = []
        state = last
        while (step := before[state]) is not None:
            run.append((step[1], state))
            state = step[0]
        yield run[::-1]


def possible(run: list[tuple[Event, State]]) -> bool:
    """Return whether nothing but the engine decides whether a run happens.

    What a run of the search may do and no robot does: two times that are over in an order that no clock has, comparisons that one number
    can't meet all, and answers about a number that scripts compute, of which the search keeps no more than they compare it with.
    """
    asked = {one.question for event, _ in run for one in event.choices}
    times = {one for one in asked if one[0] == "time"}
    numbers = Counter(one[1] for one in asked if one[0] == "compare")
    return len(times) <= 1 and max(numbers.values(), default=0) <= 1 and COMPUTED not in numbers


def trees(player: _Player) -> list[Node]:
    director = player._driver.director
    return [director.root, *([director.stop_root] if isinstance(director.stop_root, Node) else [])]


def difference(player: _Player, system: System, state: State) -> str:
    """Return in what the real mission is not in a situation, empty where it is."""
    ended = system.outcome(state)
    end = player._driver.end
    if (ended, None) != (end.outcome if end else None, None):
        return f"the mission is {end}, not {ended}"
    for skillset in system.skillsets:
        alive = player.world.managers[skillset.name].alive
        for resource in skillset.resources if alive else ():
            name = f"{skillset.name}.{resource.name}"
            if player.world.managers[skillset.name].engine.resources[resource.name].state != system.resource(state, name):
                return f"{name} is not {system.resource(state, name)}"
        if not alive and system.managers(state, skillset.name).states is not None:
            return f"the managers of {skillset.name} are not there"
    if ended:
        return ""
    active = {node.uid for root in trees(player) for node in root.iterate() if node.status is RUNNING}
    if active != {node.uid for node in system.active(state)}:
        return f"the nodes {sorted(active)} are active"
    open_ = {(leaf, one.phase) for leaf, one in system.open(state)}
    handles = {leaf: handle for leaf, handle in player._handles.items() if not handle.done}
    real = {(leaf, "sent" if handle.id in player._held else "running") for leaf, handle in handles.items()}
    return "" if real == open_ else f"{sorted(real)} is open, not {sorted(open_)}"


def taken(player: _Player, event: Event, system: System, state: State) -> str:
    """Have a step happen; return what is otherwise than in the search, empty where nothing is."""
    try:
        player.take(event)
    except LeftError as error:
        return str(error)
    return difference(player, system, state)


HOOKS = Failures(refusals=False, aborts=False)
OUTSIDE = Failures(refusals=False, hooks=False, deaths=True, pauses=True)
"""Managers that die, an abort and a pause; the mission has a tree that brings the robot to rest, or has none."""


@pytest.mark.parametrize(("seed", "failures"), [*((seed, HOOKS) for seed in range(24)), *((seed, OUTSIDE) for seed in range(24, 36))])
def test_what_is_reached_in_a_few_steps_is_reached_by_the_engine(seed: int, failures: Failures, tmp_path: Path) -> None:
    chance = random.Random(3000 + seed)  # noqa: S311 - for tests
    path = mission(chance, tmp_path)
    if failures.aborts and seed % 2:
        path.write_text(path.read_text().replace("</root>", f"{STOP}</root>"))
    system = System.of(MissionFile.read(path, robots(), PART), failures, few=EXACT)
    several = [run for run in ways(system, STEPS) if possible(run)]
    compared: set[State] = set()
    for run in chance.sample(several, min(MOST, len(several))):
        player = _Player(MissionFile.read(path, robots(), PART), run_of(system, [event for event, _ in run], run[-1][1]), None)
        for number, (event, state) in enumerate(run, 1):
            found = taken(player, event, system, state)
            assert not found, f"{found}: {[one for one, _ in run[:number]]}"
            compared.add(state)
    assert compared
