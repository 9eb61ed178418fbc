"""What a replay is asked to be: the record, and the one thing that is changed."""

from __future__ import annotations

import importlib
import importlib.util
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from alula.common.faults import FaultError, FaultRequest, parse_fault
from alula.common.robots import behaviour_files
from alula.common.scenarios import ScenarioError, load_scenario
from alula.common.suggestions import nearest
from alula.language.errors import LanguageError
from alula.language.load import load_skillset
from alula.missions.plan import MissionPlan
from alula.model.model import Skillset
from alula.records.replay.fitting import fitted
from alula.records.replay.recorded import Recorded, ReplayError
from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.mock import Behaviour, load_behaviour
from uav_missions.plan import ROBOT, plan_of
from uav_missions.route import Route, RouteError, load_route

MakePlan = Callable[[Route], MissionPlan]


def route_of(recorded: Recorded) -> Route:
    """Return the route that was flown."""
    waypoints = recorded.mission.get("route")
    if isinstance(waypoints, list) and waypoints:
        try:
            return Route([(float(x), float(y), float(z)) for x, y, z in waypoints])
        except (TypeError, ValueError):
            raise ReplayError(f"{recorded.path}: its route is no list of [x, y, z] in metres") from None
    try:
        return load_route(recorded.path.parent / "route.json")
    except RouteError as error:
        raise ReplayError(f"{recorded.path}: names no route, and {error}") from error


def plan_for(recorded: Recorded, tree: str) -> MissionPlan:
    """Return the mission's own plan, or that of ``tree``: a Python file or a module, with ``:function`` where it is not ``plan``."""
    route = route_of(recorded)
    try:
        return _tree(tree)(route) if tree else plan_of(load_scenario(recorded.scenario), route)
    except ScenarioError as error:
        raise ReplayError(f"{recorded.path}: {error}") from error


def _tree(text: str) -> MakePlan:
    place, _, function = text.partition(":")
    name = function or "plan"
    try:
        path = Path(place)
        if path.suffix == ".py":
            spec = importlib.util.spec_from_file_location("replayed_tree", path)
            if spec is None or spec.loader is None or not path.is_file():
                raise ReplayError(f"--tree {text}: there is no such file")
            module = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(module)
        else:
            module = importlib.import_module(place)
        make: MakePlan = getattr(module, name)
    except (ImportError, AttributeError, SyntaxError) as error:
        raise ReplayError(f"--tree {text}: {error}; give a module or a file that has {name}(route) -> MissionPlan") from error
    return make


def skillsets_for(plan: MissionPlan, models: Sequence[Path]) -> list[Skillset]:
    """Return the plan's models, those of files in place of the shipped ones of the same name."""
    own = {name: importlib.import_module(f"{name}_managers.model").SKILLSET for name in plan.skillsets}
    for path in models:
        try:
            other = load_skillset(path)
        except LanguageError as error:
            raise ReplayError(f"--model {path}: {str(error).splitlines()[0]}") from error
        if other.name not in own:
            raise ReplayError(f"--model {path}: the mission has no skillset {other.name}; {nearest(other.name, list(own))}")
        own[other.name] = other
    return list(own.values())


def parameters_for(recorded: Recorded, plan: MissionPlan, settings: Sequence[str]) -> dict[str, float]:
    """Return the mission's parameters: as they were, changed by ``NAME=VALUE``."""
    said = recorded.mission.get("parameters") or {}
    if not isinstance(said, Mapping):
        raise ReplayError(f"{recorded.path}: its parameters are no mapping of names to numbers")
    values = {**plan.parameters, **{name: _number(recorded, name, value) for name, value in said.items() if name in plan.parameters}}
    for setting in settings:
        name, _, text = setting.partition("=")
        name = name.removeprefix("mission.")
        if name not in values:
            raise ReplayError(f"--set {setting}: the mission has no parameter {name}; {nearest(name, list(values))}")
        try:
            values[name] = float(text)
        except ValueError:
            raise ReplayError(f"--set {setting}: {text!r} is no number") from None
        if not math.isfinite(values[name]):
            raise ReplayError(f"--set {setting}: {text!r} is no finite number")
    return values


def _number(recorded: Recorded, name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ReplayError(f"{recorded.path}: the parameter {name} is no number, but {value!r}")
    return value


def behaviour_for(recorded: Recorded, skillsets: Sequence[Skillset], files: Sequence[Path]) -> Behaviour:
    """Return what mocks do where the record has no answer: as the record fits, then the files, then the drone's own."""
    names = frozenset(skillset.name for skillset in skillsets)
    robot = [importlib.import_module(f"{name}_managers.model").SKILLSET for name in ROBOT]
    try:
        own = load_behaviour([*behaviour_files(names), *files], robot).of(names)
    except SkillRuntimeError as error:
        raise ReplayError(str(error)) from error
    return replace(fitted(recorded).over(own), faults=own.faults)


def faults_for(behaviour: Behaviour, texts: Sequence[str]) -> list[FaultRequest]:
    """Return what is to fail; raises ReplayError where the behaviour has no such fault."""
    try:
        faults = [parse_fault(text) for text in texts]
        for fault in faults:
            behaviour.fault(fault)
    except (FaultError, SkillRuntimeError) as error:
        raise ReplayError(f"--fail: {error}") from error
    return faults
