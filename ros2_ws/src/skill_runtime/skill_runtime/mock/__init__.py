"""Mocks: skills whose behaviour is a script, over the same managers and the same interface as the real ones."""

from skill_runtime.mock.behaviour import NEVER, Behaviour, Change, DataScript, Ending, MockFault, Rule, TimelineEvent, Value
from skill_runtime.mock.errors import BehaviourError
from skill_runtime.mock.formula import Formula, FormulaError
from skill_runtime.mock.host import MockHost
from skill_runtime.mock.local_host import LocalMockHost, follow, mock_world, serve_robot
from skill_runtime.mock.reading import load_behaviour
from skill_runtime.mock.robot import MockRobot
from skill_runtime.mock.skill import Choice, MockSkill
from skill_runtime.mock.starter import starter
from skill_runtime.mock.state import MockState

__all__ = [
    "NEVER",
    "Behaviour",
    "BehaviourError",
    "Change",
    "Choice",
    "DataScript",
    "Ending",
    "Formula",
    "FormulaError",
    "LocalMockHost",
    "MockFault",
    "MockHost",
    "MockRobot",
    "MockSkill",
    "MockState",
    "Rule",
    "TimelineEvent",
    "Value",
    "follow",
    "load_behaviour",
    "mock_world",
    "serve_robot",
    "starter",
]
