"""Checks files of trees: their structure first, then the whole tree as it will stand."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice

from alula.check import entries
from alula.check.entries import Writers
from alula.check.exclusion import exclude
from alula.check.problems import of_element
from alula.check.reach import never_reached, several_run, unreached, waits_in_vain
from alula.check.scripts import Scripts
from alula.check.unread import never_read
from alula.check.whole import Rule, Whole
from alula.trees import nav2
from alula.trees.access import Accesses, scripts_of
from alula.trees.attributes import type_name
from alula.trees.blackboard import Blackboard
from alula.trees.configuration import configure
from alula.trees.errors import Problem
from alula.trees.library import Library
from alula.trees.node import Shared
from alula.trees.ports import Direction
from alula.trees.reach import Reach
from alula.trees.reading import TreeFiles
from alula.trees.registry import NodeRegistry
from alula.trees.structure import verify

ENDLESS = frozenset({"ALU007", "ALU009"})
"""What keeps the tree from being put together at all."""


MOST = 100
"""Problems of one rule that are told: who has more has enough to do."""


class _Enough(Exception):  # noqa: N818 - ends what goes on reporting
    """There are as many problems as are told."""


@dataclass(frozen=True)
class Beside:
    """Trees that stand on the main tree's blackboard, if the files have them: ``before`` it begins, and ``later``, at any moment of it."""

    before: tuple[str, ...] = ()
    later: tuple[str, ...] = ()


def check(
    files: TreeFiles,
    registry: NodeRegistry,
    names: Collection[str] = (),
    rules: Iterable[Rule] = (),
    *,
    beside: Beside = Beside(),
    foreign: bool = False,
    of_others: bool = False,
    checked: Library | None = None,
) -> list[Problem]:
    """Return what is wrong with the files, each thing once, in the order of the source.

    ``names`` stand in scripts for something else than an entry, ``rules`` are more than those of trees alone.

    The blackboard of a ``foreign`` mission may be filled from outside with what no file tells of; trees ``of_others`` have nodes that no
    file declares. All files of the library ``checked`` are checked, each by itself: what is wrong in a tree that others use, they tell.
    """
    found: list[Problem] = []

    def report(problem: Problem) -> None:
        if len(found) == MOST:
            raise _Enough
        found.append(problem)

    with suppress(_Enough):
        verify(files, registry, report, of_others=of_others, others=() if checked is None else checked.documents)
    is_told = checked is not None and files.is_part and files.main in files.trees and checked.has_user(files.trees[files.main])
    if files.trees and not is_told and not any(problem.code in ENDLESS for problem in found):
        wholes = list(_wholes(files, registry, names, beside, foreign=foreign))
        found += _problems(wholes, (*RULES, *rules))
        if all(problem.warning for problem in found):  # else what is to be mended may be what reads it
            found += _problems(wholes, [never_read])
    places: dict[tuple[object, ...], Problem] = {}
    for problem in found:
        places.setdefault((problem.code, problem.place, problem.message), problem)
    return sorted(places.values(), key=lambda one: (one.place.path != files.path, one.place.path, one.place.line, one.place.column))


def _wholes(files: TreeFiles, registry: NodeRegistry, names: Collection[str], beside: Beside, *, foreign: bool) -> Iterator[Whole]:
    model = files.models.get(files.main)
    scripts, reach, shared = Scripts(), Reach(), Shared(int)
    accesses = Accesses(scripts.statements, names)
    given, others = tuple(model.ports) if model else (), Writers()
    # A tree of these is ticked by itself, also where the main one has it as a subtree, over other entries then.
    started = [name for name in (*beside.before, *beside.later) if name in files.trees and name != files.main]
    mains = [files.main] if files.main in files.trees else []
    several = dict.fromkeys((*mains, *started, *_others(files)))
    board = Blackboard(shared.clock)
    boards = dict.fromkeys((*mains, *started), board)
    roots = {one: configure(files, registry, one, shared, blackboard=boards.get(one)) for one in several if files.trees[one].children}
    for name, root in roots.items():
        known = given if name in started or (name == files.main and not files.is_part) else None
        around = tuple(roots[one] for one in boards if one in roots and one != name) if name in boards else ()
        yield Whole(root, scripts, accesses, reach, names, known, others, name in beside.later, foreign, around)
        if name == files.main:
            others = entries.written(root, accesses)


def _problems(wholes: Iterable[Whole], rules: Iterable[Rule]) -> Iterator[Problem]:
    several = list(rules)
    for whole in wholes:
        for rule in several:
            yield from islice(rule(whole), MOST)


def _others(files: TreeFiles) -> list[str]:
    """Return the trees besides the main one that no tree contains."""
    tops = [top for tree in files.trees.values() for top in tree.children]
    used = {type_name(one) for top in tops for one in top.iterate() if one.tag == "SubTree"}
    return [name for name in files.trees if name not in used and name != files.main]


def _scripts(whole: Whole) -> Iterator[Problem]:
    for config in whole.root.walk():
        for attribute in scripts_of(config.element, config.type):
            whole.scripts.program(attribute)
    yield from whole.scripts.problems


def _missing(whole: Whole) -> Iterator[Problem]:
    """Yield inputs that a file does not give and that have no default; of nodes that only a model tells of, nobody knows."""
    for config in whole.root.walk():
        for port in config.type.ports.values() if config.type.is_tickable else ():
            if port.direction is not Direction.OUTPUT and not port.optional and config.ports.get(port.name) is None and not port.required:
                message = f"'{config.type.name}' has no input '{port.name}', which has no default"
                yield of_element("ALU604", config.element, message, f'add {port.name}="..."', warning=whole.foreign)


def _unreached(whole: Whole) -> Iterator[Problem]:
    waited = list(waits_in_vain(whole.root, whole.reach))
    yield from (problem for problem, _ in waited)
    explained = {config for _, config in waited}
    for child, waits_for in unreached(whole.root, whole.reach):
        if waits_for not in explained:
            yield never_reached(child, waits_for, whole.reach)


def _several_run(whole: Whole) -> Iterator[Problem]:
    return several_run(whole.root, whole.reach, lambda one, other: exclude(one, other, whole.scripts, whole.names))


def _entries(whole: Whole) -> Iterator[Problem]:
    if whole.given is not None:
        of_nav2 = whole.foreign and any(config.type.name in nav2.declared() for config in whole.root.walk())
        given = (*whole.given, *(nav2.WRITTEN if of_nav2 else ()))
        yield from entries.read_too_early(whole.root, whole.accesses, given, whole.others, late=whole.begins_late, foreign=whole.foreign)
    yield from entries.mismatched(whole.root, whole.accesses)


RULES: tuple[Rule, ...] = (_scripts, _missing, _unreached, _several_run, _entries)
