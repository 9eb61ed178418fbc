"""Mocks: skills whose behaviour is a script, over the same managers and the same interface as the real ones."""

from alula.mock.behaviour import NEVER, Behaviour, DataScript, Ending, MockChange, MockFault, Rule, TimelineEvent, Value
from alula.mock.errors import BehaviourError
from alula.mock.formula import Formula, FormulaError
from alula.mock.host import MockHost
from alula.mock.local_host import LocalMockHost, follow, mock_world, serve_robot
from alula.mock.reading import load_behaviour
from alula.mock.robot import MockRobot
from alula.mock.skill import Choice, MockSkill
from alula.mock.starter import starter
from alula.mock.state import MockState

__all__ = [
    "NEVER",
    "Behaviour",
    "BehaviourError",
    "Choice",
    "DataScript",
    "Ending",
    "Formula",
    "FormulaError",
    "LocalMockHost",
    "MockChange",
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
