"""Mocks: skills whose behaviour is a script, over the same managers and the same interface as the real ones."""

from alula.runtime.mock.behaviour import NEVER, Behaviour, DataScript, Ending, MockChange, MockFault, Rule, TimelineEvent, Value
from alula.runtime.mock.errors import BehaviourError
from alula.runtime.mock.formula import Formula, FormulaError
from alula.runtime.mock.host import MockHost
from alula.runtime.mock.local_host import LocalMockHost, follow, mock_world, serve_robot
from alula.runtime.mock.reading import load_behaviour
from alula.runtime.mock.robot import MockRobot
from alula.runtime.mock.skill import Choice, MockSkill
from alula.runtime.mock.starter import starter
from alula.runtime.mock.state import MockState

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
