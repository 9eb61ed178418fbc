"""Moves sets of situations forwards and backwards by whole steps: an update, and all violations that it causes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from skill_language.prove.bdd_model import ENDED, Encoded, Update
from skill_language.prove.limits import Deadline
from skill_language.prove.steps import State


class Sets:
    """The reachable situations of a skillset as one diagram, ``reached``."""

    def __init__(self, model: Encoded, deadline: Deadline) -> None:
        self.model = model
        self.bdd = model.bdd
        self.deadline = deadline
        self.inside = self.bdd.false
        """All that is ever found broken within a step, to keep the way back narrow."""
        self.initial = self._initial()
        self.reached = self._reach()

    # --- forwards -------------------------------------------------------------------------------------------------

    def _initial(self) -> Any:
        values: dict[str, bool] = {}
        for resource in self.model.skillset.resources:
            values |= self.model.values_of(resource.name, resource.initial)
        others = {name: False for name in self.bdd.vars if name not in values and name != ENDED}
        return self.bdd.cube(values | others)

    def _reach(self) -> Any:
        """Take each step again and again until it adds nothing, then the next, until none adds anything."""
        reached, before = self.initial, self.bdd.false
        while reached != before:
            before = reached
            for update in self.model.steps:
                fresh = reached
                while fresh != self.bdd.false:
                    self.deadline.check()
                    fresh = self.after(fresh, update) & ~reached
                    reached |= fresh
        return reached

    def after(self, situations: Any, update: Update) -> Any:
        """Return what a step makes of situations."""
        changed = self._updated(situations, update)
        watching = {skill for resource in update.changed for skill in self.model.watchers.get(resource, ())}
        return self._settled(self._marked(changed, {*watching, *([update.starts] if update.starts else [])}))

    def _updated(self, situations: Any, update: Update) -> Any:
        taken = situations & update.guard
        if taken == self.bdd.false:
            return taken
        return self.bdd.exist(list(update.values), taken) & self.bdd.cube(dict(update.values))

    def _marked(self, situations: Any, skills: Iterable[str]) -> Any:
        """Mark executions whose invariant is false, by its first false one, unless they are marked already."""
        if situations == self.bdd.false:
            return situations
        for skill in sorted(skills):
            marks = self.model.marks.get(skill, [])
            unmarked = situations & self.model.all_of(~self.bdd.var(name) for name, _ in marks)
            for name, first_false in marks:
                found = unmarked & first_false
                if found != self.bdd.false:
                    situations = (situations & ~found) | (self.bdd.exist([name], found) & self.bdd.var(name))
        return situations

    def _settled(self, situations: Any) -> Any:
        done = self.bdd.false
        while situations != self.bdd.false:
            done |= situations & self.model.idle
            situations &= ~self.model.idle
            self.inside |= situations
            following = self.bdd.false
            for name, updates in self.model.violations.items():
                broken = situations & self.bdd.var(name)
                if broken == self.bdd.false:
                    continue
                for update in updates:
                    watching = {skill for resource in update.changed for skill in self.model.watchers.get(resource, ())}
                    following |= self._marked(self._updated(broken, update), watching)
            situations = following
        return done

    # --- backwards ------------------------------------------------------------------------------------------------

    def before(self, situations: Any, *, within: Any = None, ending: str = "") -> Any:
        """Return the reachable situations with a step to one of these, or (``within``) with a step in which it comes to that.

        With ``ending`` only steps that end an execution of this skill count.
        """
        goal = situations & self.model.idle
        if within is not None:
            goal |= within & self.inside
        ended = self.bdd.var(ENDED)
        unsettled = self._before_settling(goal & ended if ending else goal, ending)
        result = self.bdd.false
        for update in self.model.steps:
            self.deadline.check()
            result |= self._undone(unsettled, update, ending) & self.reached
        if ending:
            result = self.bdd.let({ENDED: False}, result)
        return result & self.reached

    def _undone(self, situations: Any, update: Update, ending: str) -> Any:
        values: Mapping[str, bool] = update.values
        if ending and update.ends == ending:
            values = {**values, ENDED: True}
        return update.guard & self.bdd.let(dict(values), situations)

    def _before_settling(self, goal: Any, ending: str) -> Any:
        """Return the situations, right after an update, that settle to the goal."""
        marked = goal
        while True:
            self.deadline.check()
            unmarked = self._before_marking(marked)
            earlier = self.bdd.false
            for name, updates in self.model.violations.items():
                for update in updates:
                    earlier |= self._undone(unmarked, update, ending) & self.bdd.var(name) & self.inside
            if earlier & ~marked == self.bdd.false:
                return unmarked
            marked |= earlier

    def _before_marking(self, situations: Any) -> Any:
        for marks in self.model.marks.values():
            unmarked = self.model.all_of(~self.bdd.var(name) for name, _ in marks)
            changed = self.bdd.false
            left = situations
            for name, first_false in marks:
                found = unmarked & first_false
                changed |= found & self.bdd.let({name: True}, situations)
                left &= ~found
            situations = changed | left
        return situations

    def can_come_to(self, goal: Any, *, avoiding: Any = None) -> Any:
        """Return the reachable situations from which some run comes to the goal, all before it being none of ``avoiding``."""
        allowed = self.reached if avoiding is None else self.reached & ~avoiding
        found = goal & self.reached
        fresh = found
        while fresh != self.bdd.false:
            fresh = self.before(fresh) & allowed & ~found
            found |= fresh
        return found

    # --- single situations ----------------------------------------------------------------------------------------

    def contains(self, situations: Any, state: State) -> bool:
        """Tell whether a situation is in a set."""
        values: dict[str, bool] = dict.fromkeys(self.bdd.vars, False)
        for resource, value in zip(self.model.skillset.resources, state.resources, strict=True):
            values |= self.model.values_of(resource.name, value)
        for skill in state.running:
            values[f"runs {skill} 1"] = True
        for skill in set(state.running):
            for count in range(2, state.running.count(skill) + 1):
                values[f"runs {skill} {count}"] = True
        return bool(self.bdd.let(values, situations) == self.bdd.true)

    def count(self) -> int:
        """Return how many situations are reachable, ages of executions aside."""
        return int(self.bdd.count(self.reached, nvars=len(self.bdd.vars) - 1))
