"""Ticks that are known from others which read the same, held against the engine: each memory and each outcome is the same."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import pytest
import test_prove_mission_live as entries
import test_prove_mission_runs as anything

from alula.missions.mission_file import MissionFile
from alula.prove.limits import Deadline, OutOfTimeError
from alula.prove.mission.managers import Failures
from alula.prove.mission.oracle import UndecidedError
from alula.prove.mission.regions import Regions
from alula.prove.mission.repeated import Repeated
from alula.prove.mission.system import System
from alula.prove.mission.ticking import Ticker
from alula.prove.mission.touched import Touched, TouchedEntries
from alula.trees.blackboard import Entry
from alula.trees.values import ANY

FAILURES = Failures(hooks=False, refusals=False, aborts=True, pauses=True)


def ticker_of(path: Path) -> tuple[Ticker, str]:
    """Return what is known of the ticks of a mission when its runs were looked at, and how that ended."""
    system = System.of(MissionFile.read(path, anything.robots(), anything.PART), FAILURES)
    regions = Regions(system, Deadline.after(1e6))
    regions._deadline = anything.Many.after(1e6)
    try:
        regions.explore()
    except (OutOfTimeError, UndecidedError) as error:
        return system.ticker, f"{type(error).__name__} {error}"
    return system.ticker, ""


def without_conditions(chance: random.Random, folder: Path) -> Path:
    return entries.written(folder, f"{entries.ONCE}{entries.tree(chance, 3)}{entries.tree(chance, 2)}")


def with_own_nodes(chance: random.Random, folder: Path) -> Path:
    return anything.with_conditions(anything.mission(chance, folder, 3), chance)


def of_data(chance: random.Random, folder: Path) -> Path:
    return anything.mission(chance, folder, 2, anything.MEASURED)


@pytest.mark.parametrize("made", [without_conditions, with_own_nodes, of_data])
@pytest.mark.parametrize("seed", range(20))
def test_a_tick_that_reads_the_same_does_the_same(
    made: Callable[[random.Random, Path], Path], seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = made(random.Random(seed), tmp_path)  # noqa: S311 - for tests
    repeated, how = ticker_of(path)
    monkeypatch.setattr(Repeated, "find", lambda *_: None)
    engine, how_engine = ticker_of(path)
    assert how == how_engine
    assert [repr(one) for one in repeated.memories] == [repr(one) for one in engine.memories]
    assert repeated._known == engine._known
    assert repeated.runs <= engine.runs


def test_ticks_that_read_the_same_are_done_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    several = "".join(f'<ForceSuccess><drone.hover outcome="{{{name}}}"/></ForceSuccess>' for name in "cdefgh")
    last = "".join(f"<ScriptCondition code=\"{name} == 'DONE'\"/>" for name in "cdefgh")
    path = entries.written(tmp_path, f"{several}{last}")
    repeated, _ = ticker_of(path)
    monkeypatch.setattr(Repeated, "find", lambda *_: None)
    engine, _ = ticker_of(path)
    assert repeated.runs * 2 < engine.runs


def test_all_ways_to_look_at_an_entry_are_noted() -> None:
    touched = Touched(lambda: 7)
    held = TouchedEntries(3, touched)
    held["a"] = Entry(ANY)
    touched.begin()
    assert held.get("a") is held["a"]
    assert "b" not in held
    held.pop("c", None)
    held.setdefault("d", Entry(ANY))
    held["e"] = Entry(ANY)
    assert touched.places == {(3, name): 7 for name in "abcde"}
    touched.end()
    assert "f" not in held
    assert (3, "f") not in touched.places


@pytest.mark.parametrize("look", [list, dict, len, bool, lambda held: held.copy(), lambda held: list(held.values())])
def test_who_looks_at_all_entries_may_hang_on_each(look: Callable[[TouchedEntries], object]) -> None:
    touched = Touched(lambda: 0)
    held = TouchedEntries(0, touched)
    held["a"] = Entry(ANY)
    touched.begin()
    look(held)
    assert touched.everything
