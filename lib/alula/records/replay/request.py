"""The request of a replay: the record, and the one thing that is changed (tree, models, parameters, mocks, faults)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from alula.common.faults import FaultError, FaultRequest, parse_fault
from alula.common.robots import RobotError, find_robot
from alula.common.scenarios import ScenarioError, load_scenario
from alula.common.suggestions import with_nearest
from alula.language.errors import LanguageError
from alula.language.load import load_skillset
from alula.missions.plan import InputError, Inputs, MissionPlan
from alula.missions.scenario import plan_of, plan_of_mission_file
from alula.mock import Behaviour
from alula.model.model import Skillset
from alula.records.errors import AnalysisError
from alula.records.mocks import behaviour_of
from alula.records.models import robot_skillsets
from alula.records.replay.fitting import fitted, with_untold
from alula.records.replay.recorded import Recorded, ReplayError
from alula.runtime.core.errors import SkillRuntimeError


def inputs_of_record(recorded: Recorded) -> Inputs:
    """Return what the mission was made of."""
    # Older records have what a mission was made of among the facts of its outcome.
    inputs = recorded.mission.get("inputs", recorded.mission)
    if not isinstance(inputs, Mapping):
        raise ReplayError(f"{recorded.path}: the inputs of its mission are no mapping")
    return inputs


def plan_for(recorded: Recorded, tree: str) -> MissionPlan:
    """Return the mission's own plan, or that of the file ``tree``."""
    inputs = inputs_of_record(recorded)
    try:
        scenario, models = load_scenario(recorded.scenario), robot_skillsets()
        return plan_of_mission_file(Path(tree), scenario, inputs, models) if tree else plan_of(scenario, inputs, models)
    except (ScenarioError, RobotError, InputError, AnalysisError) as error:
        raise ReplayError(f"{recorded.path}: {error}") from error


def skillsets_for(plan: MissionPlan, models: Sequence[Path]) -> list[Skillset]:
    """Return the plan's models, those of files in place of the shipped ones of the same name."""
    try:
        own = {skillset.name: skillset for skillset in robot_skillsets(plan.skillsets)}
    except AnalysisError as error:
        raise ReplayError(str(error)) from error
    for path in models:
        try:
            other = load_skillset(path)
        except LanguageError as error:
            raise ReplayError(f"--model {path}: {str(error).splitlines()[0]}") from error
        if other.name not in own:
            raise ReplayError(with_nearest(f"--model {path}: the mission has no skillset {other.name}", other.name, own))
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
            raise ReplayError(with_nearest(f"--set {setting}: the mission has no parameter {name}", name, values))
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
    """Return what mocks do where the record has no answer: as the record fits, then the files, then the robot's own.

    Of what they have happen by the clock there is only what the record tells nothing of.
    """
    names = frozenset(skillset.name for skillset in skillsets)
    try:
        own = behaviour_of(find_robot(), files).of(names)
    except (SkillRuntimeError, RobotError, AnalysisError) as error:
        raise ReplayError(str(error)) from error
    return replace(with_untold(recorded, fitted(recorded).over(own)), faults=own.faults)


def faults_for(behaviour: Behaviour, texts: Sequence[str]) -> list[FaultRequest]:
    """Return what is to fail; raises ReplayError where the behaviour has no such fault."""
    try:
        faults = [parse_fault(text) for text in texts]
        for fault in faults:
            behaviour.fault(fault)
    except (FaultError, SkillRuntimeError) as error:
        raise ReplayError(f"--fail: {error}") from error
    return faults
