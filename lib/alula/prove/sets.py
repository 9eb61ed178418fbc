"""Moves sets of situations forwards and backwards by whole steps: an update, and all violations that it causes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from alula.prove.diagrams import ENDED, Cluster, Encoded, Update
from alula.prove.limits import Deadline
from alula.prove.steps import State

MANY_NODES = 200_000
"""From here on CUDD may look for a better order of the variables; below, its looking costs more than it gains (see ``bench``)."""


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
            if len(self.bdd) > MANY_NODES:
                self.bdd.configure(reordering=True)
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
        return self._settled(changed, {*watching, *([update.touches] if update.touches else [])})

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

    def _settled(self, situations: Any, concerned: set[str]) -> Any:
        """Mark and end all broken executions; those of one cluster know nothing of the others', so that one follows the other."""
        for cluster in (one for one in self.model.clusters if concerned.intersection(one.skills)):
            self.deadline.check()
            situations = self._marked(situations, concerned.intersection(cluster.skills))
            if situations & ~cluster.idle != self.bdd.false:
                situations = self._settled_in(cluster, situations)
        return situations

    def _settled_in(self, cluster: Cluster, situations: Any) -> Any:
        done = self.bdd.false
        while situations != self.bdd.false:
            self.deadline.check()
            done |= situations & cluster.idle
            situations &= ~cluster.idle
            self.inside |= situations
            following = self.bdd.false
            for name in cluster.broken:
                broken = situations & self.bdd.var(name)
                for update in self.model.violations[name] if broken != self.bdd.false else ():
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
        if ending:
            goal &= self.bdd.var(ENDED)
        unsettled = self._before_settling(goal, self.bdd.false if within is None else within, ending)
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

    def _before_settling(self, goal: Any, within: Any, ending: str) -> Any:
        """Return the situations, right after an update, that settle to the goal or come to be within on the way."""
        for cluster in reversed(self.model.clusters):
            seeds = within & self.inside & ~cluster.idle
            goal = self._before_marking(self._before_settling_in(cluster, goal | seeds, ending), cluster.skills)
        return goal

    def _before_settling_in(self, cluster: Cluster, goal: Any, ending: str) -> Any:
        fresh = goal
        while fresh != self.bdd.false:
            self.deadline.check()
            unmarked = self._before_marking(fresh, cluster.skills)
            earlier = self.bdd.false
            for name in cluster.broken:
                here = self.inside & self.bdd.var(name)
                for update in self.model.violations[name]:
                    earlier |= self._undone(unmarked, update, ending) & here
            fresh = earlier & ~goal
            goal |= fresh
        return goal

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

    def can_come_to(self, goal: Any, *, avoiding: Any = None) -> Any:
        """Return the reachable situations from which some run comes to the goal, all before it being none of ``avoiding``."""
        allowed = self.reached if avoiding is None else self.reached & ~avoiding
        found = goal & self.reached
        fresh = found
        while fresh != self.bdd.false:
            # What is found goes on being used in the same round: right after an update, a situation of ``found`` is settled.
            ways = self._before_settling(fresh & self.model.idle, self.bdd.false, "")
            before = found
            for update in self.model.steps:
                self.deadline.check()
                earlier = self._undone(ways, update, "") & allowed & ~found
                found |= earlier
                ways |= earlier
            fresh = found & ~before
        return found

    # --- single situations ----------------------------------------------------------------------------------------

    def contains(self, situations: Any, state: State) -> bool:
        """Tell whether a situation is in a set."""
        return bool(self.bdd.let(self._values(state), situations) == self.bdd.true)

    def only(self, states: Iterable[State]) -> Any:
        """Return the set of these situations."""
        values = ({name: value for name, value in self._values(state).items() if name != ENDED} for state in states)
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
        return int(self.bdd.count(self.reached, nvars=len(self.bdd.vars) - 1))
