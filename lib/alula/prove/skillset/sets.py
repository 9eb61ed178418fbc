"""Moves sets of situations forwards and backwards by whole steps: an update, and all violations that it causes."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator
from typing import Any

from alula.prove.limits import Deadline
from alula.prove.skillset.aftermath import Aftermath, Group, Step
from alula.prove.skillset.bound import Bound
from alula.prove.skillset.diagrams import ENDED, Encoded, Update, Within, runs_name
from alula.prove.skillset.steps import State

MANY_NODES = 200_000
"""From here on CUDD may look for a better order of the variables; below, its looking costs more than it gains (see ``bench``)."""

MOST_NODES = 3
"""For each variable. A larger set of all that can be reached is given up for the bound: it would go on growing (see ``bench``)."""


class Sets:
    """The reachable situations of a skillset as one diagram, ``reached``.

    Where that diagram becomes too large, and ``exact`` is false, it is one of more situations (see ``bound``). Whatever is
    found backwards within it is true of those that can be reached: what follows one of these can be reached, too.
    """

    def __init__(self, model: Encoded, deadline: Deadline) -> None:
        self.model = model
        self.bdd = model.bdd
        self.deadline = deadline
        self.bound = Bound(model, deadline)
        self.aftermath = Aftermath(model, self.bound)
        self.initial = self._initial()
        self.steps = self._steps()
        self.exact = True
        self.reached = self._reach(MOST_NODES * len(self.bdd.vars))
        if not self.exact:
            self.reached = self.bound.within_limits(self.bdd.true, (block.settled for block in self.bound.blocks.values()))

    def _steps(self) -> list[Step]:
        """Return the steps in the order of the last variable that they have to do with: what concerns much comes late."""
        steps: list[Step] = []
        for update in self.model.steps:
            self.deadline.check()
            steps.append(self.aftermath.step(update))
        level = self.bdd.var_levels
        return sorted(steps, key=lambda step: max(level[name] for name in step.about))

    def until(self, deadline: Deadline) -> None:
        """Set another deadline."""
        self.deadline = self.bound.deadline = deadline

    def complete(self) -> None:
        """Compute exactly the reachable situations in ``reached``, however large the diagram is."""
        self.exact = True
        self.reached = self._reach(None)

    # --- forwards -------------------------------------------------------------------------------------------------

    def _initial(self) -> Any:
        values: dict[str, bool] = {}
        for resource in self.model.skillset.resources:
            values |= self.model.values_of(resource.name, resource.initial)
        runs = {runs_name(skill, number): False for skill, most in self.model.copies.items() for number in range(1, most + 1)}
        return self.bdd.cube(values | runs)

    def _reach(self, most: int | None) -> Any:
        """Take each step again and again until it adds nothing; after one that adds, all again that have to do with it.

        The first step of those goes first (saturation, after Ciardo): sets of few parts are closed before more parts move.
        With ``most`` nodes it is given up, and not ``exact``.
        """
        related = self._related()
        waiting = list(range(len(self.steps)))
        queued = set(waiting)
        reached = self.initial
        while waiting:
            number = heapq.heappop(waiting)
            queued.discard(number)
            before = fresh = reached
            while fresh != self.bdd.false:
                self.deadline.check()
                fresh = self.after(fresh, self.steps[number]) & ~reached
                reached |= fresh
            if reached == before:
                continue
            if most is not None and len(reached) > most:
                self.exact = False
                return reached
            if len(self.bdd) > MANY_NODES:
                self.bdd.configure(reordering=True)
            for other in related[number] - queued:
                heapq.heappush(waiting, other)
                queued.add(other)
        return reached

    def _related(self) -> list[set[int]]:
        """Return for each step the others that it may enable or come before in another way: one sets what the other is about."""
        setting: dict[str, set[int]] = {}
        asking: dict[str, set[int]] = {}
        for number, step in enumerate(self.steps):
            for name in step.sets:
                setting.setdefault(name, set()).add(number)
            for name in step.about:
                asking.setdefault(name, set()).add(number)
        return [
            set().union(*(asking.get(name, set()) for name in step.sets), *(setting.get(name, set()) for name in step.about)) - {number}
            for number, step in enumerate(self.steps)
        ]

    def after(self, situations: Any, step: Step) -> Any:
        """Return the situations after a step from these."""
        changed = self._updated(situations, step.update)
        for group in step.groups if changed != self.bdd.false else ():
            changed = self._settled(group, changed)
        return changed

    def _updated(self, situations: Any, update: Update) -> Any:
        taken = situations & update.guard
        if taken == self.bdd.false:
            return taken
        return self.bdd.exist(list(update.values), taken) & self.bdd.cube(dict(update.values))

    def _marked(self, situations: Any, skills: Iterable[str]) -> Any:
        """Mark executions whose invariant is false, by its first false one, unless they are marked already."""
        if situations == self.bdd.false:
            return situations
        for skill in skills:
            marks = self.model.marks.get(skill, [])
            unmarked = situations & self.model.all_of(~self.bdd.var(name) for name, _ in marks)
            for name, first_false in marks:
                found = unmarked & first_false
                if found != self.bdd.false:
                    situations = (situations & ~found) | (self.bdd.exist([name], found) & self.bdd.var(name))
        return situations

    def _settled(self, group: Group, situations: Any) -> Any:
        """Mark and end all broken executions of a group; those of another know nothing of them, so that one follows the other."""
        situations = self._marked(situations & group.idle, group.first)
        done = self.bdd.false
        while situations != self.bdd.false:
            self.deadline.check()
            done |= situations & group.idle
            situations &= ~group.idle
            following = self.bdd.false
            for name in group.broken:
                broken = situations & self.bdd.var(name)
                for update in self.model.violations[name] if broken != self.bdd.false else ():
                    following |= self._marked(self._updated(broken, update), self.aftermath.watching(name, update))
            situations = following
        return self.bdd.exist(list(group.broken), done)

    # --- backwards ------------------------------------------------------------------------------------------------

    def before(self, situations: Any, *, within: Within | None = None, ending: str = "") -> Any:
        """Return the situations with a step to one of these.

        Those with a step in which it comes to ``within`` are meant, too. With ``ending`` only steps that end an execution of
        this skill count.
        """
        goal = situations & self.bdd.var(ENDED) if ending else situations
        result = self.bdd.false
        for step in self.steps:
            if not ending or ending in step.ends:
                self.deadline.check()
                result |= self._one_before(step, goal, within, ending)
        if ending:
            result = self.bdd.let({ENDED: False}, result)
        return result

    def staying(self, situations: Any) -> Any:
        """Return the situations of a set that have a step back into it."""
        left = situations
        for step in sorted(self.steps, key=lambda one: not one.update.ends):
            if left == self.bdd.false:
                break
            self.deadline.check()
            left &= ~self._one_before(step, situations)
        return situations & ~left

    def nearer(self, situations: Any) -> Iterator[Any]:
        """Yield, step by step, ``before`` without situations that the step leaves unchanged in all variables of these."""
        about = set(self.bdd.support(situations))
        for step in self.steps:
            if not about.isdisjoint(step.sets):
                self.deadline.check()
                yield self.narrowed(self._one_before(step, situations))

    def narrowed(self, situations: Any) -> Any:
        """Return a set without situations that are known to be unreachable."""
        return situations & self.reached if self.exact else self.bound.narrowed(situations)

    def _one_before(self, step: Step, situations: Any, within: Within | None = None, ending: str = "") -> Any:
        """Return the situations that one step takes to these."""
        for group in reversed(step.groups):
            seeds = within.situations if within is not None and within.broken in group.broken else self.bdd.false
            if seeds == self.bdd.false and not ending and group.sets.isdisjoint(self.bdd.support(situations)):
                continue  # whatever it ends, it leaves these situations as they are
            situations = self._before_settling(group, situations, seeds, ending)
        return self._undone(situations, step.update, ending)

    def _undone(self, situations: Any, update: Update, ending: str = "") -> Any:
        values = {**update.values, ENDED: True} if ending and update.ends == ending else dict(update.values)
        return update.guard & self.bdd.let(values, situations)

    def _before_settling(self, group: Group, situations: Any, seeds: Any, ending: str) -> Any:
        """Return the situations, right after an update, that settle to these or come to be among the seeds on the way."""
        found = fresh = (situations & group.idle) | seeds
        while fresh != self.bdd.false:
            self.deadline.check()
            earlier = self.bdd.false
            for name in group.broken:
                for update in self.model.violations[name]:
                    unmarked = self._before_marking(fresh, self.aftermath.watching(name, update))
                    earlier |= self._undone(unmarked, update, ending) & self.bdd.var(name) & self.bound.unmarked(update.changed)
            fresh = earlier & ~found
            found |= fresh
        found = self._before_marking(found, group.first)
        return self.bdd.let(dict.fromkeys(group.broken, False), found)

    def _before_marking(self, situations: Any, skills: Iterable[str]) -> Any:
        for skill in skills:
            marks = self.model.marks.get(skill, [])
            unmarked = self.model.all_of(~self.bdd.var(name) for name, _ in marks)
            changed, left = self.bdd.false, situations
            for name, first_false in marks:
                found = unmarked & first_false
                changed |= found & self.bdd.let({name: True}, situations)
                left &= ~found
            situations = changed | left
        return situations

    def can_come_to(self, goal: Any, *, inside: Any = None) -> Any:
        """Return the situations with a run to the goal; all are reachable, or in ``inside`` where that is given."""
        allowed = self.reached if inside is None else inside
        found, before = goal & allowed, self.bdd.false
        # What ends executions leads back: steps of this kind may be all that is needed.
        for steps in ([step for step in self.steps if step.update.ends], self.steps):
            while found != before:
                before = found
                for step in steps:
                    self.deadline.check()
                    if allowed & ~found == self.bdd.false:
                        return found
                    found |= self._one_before(step, found) & allowed
            before = self.bdd.false
        return found

    # --- single situations ----------------------------------------------------------------------------------------

    def contains(self, situations: Any, state: State) -> bool:
        """Return whether a situation is in a set."""
        return bool(self.bdd.let(self._values(state), situations) == self.bdd.true)

    def only(self, states: Iterable[State]) -> Any:
        """Return the set that holds only these situations."""
        # Of a situation after a step alone: variables that only some searches use would leave the rest of a set behind.
        about = self.bdd.support(self.initial)
        values = ({name: value for name, value in self._values(state).items() if name in about} for state in states)
        return self.model.any_of(self.bdd.cube(one) for one in values)

    def _values(self, state: State) -> dict[str, bool]:
        values: dict[str, bool] = dict.fromkeys(self.bdd.vars, False)
        for resource, value in zip(self.model.skillset.resources, state.resources, strict=True):
            values |= self.model.values_of(resource.name, value)
        for skill in state.running:
            values[f"runs {skill} 1"] = True
        for skill in set(state.running):
            for count in range(2, state.running.count(skill) + 1):
                values[f"runs {skill} {count}"] = True
        return values

    def count(self) -> int:
        """Return how many situations are reachable, ages of executions aside."""
        return int(self.bdd.count(self.reached, nvars=len(self.initial.support)))
