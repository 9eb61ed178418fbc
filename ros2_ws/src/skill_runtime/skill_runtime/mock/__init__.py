"""Mocks: skills whose behaviour is a script, over the same managers and the same interface as the real ones."""

from skill_runtime.mock.behaviour import NEVER, Behaviour, Change, DataScript, Ending, Fault, Happening, Rule, Value
from skill_runtime.mock.errors import BehaviourError
from skill_runtime.mock.formula import Formula, FormulaError
from skill_runtime.mock.local_stage import LocalStage, follow, mock_world, serve_play
from skill_runtime.mock.play import Play
from skill_runtime.mock.reading import load_behaviour
from skill_runtime.mock.skill import Choice, MockSkill
from skill_runtime.mock.stage import Stage
from skill_runtime.mock.starter import starter

__all__ = [
    "NEVER",
    "Behaviour",
    "BehaviourError",
    "Change",
    "Choice",
    "DataScript",
    "Ending",
    "Fault",
    "Formula",
    "FormulaError",
    "Happening",
    "LocalStage",
    "MockSkill",
    "Play",
    "Rule",
    "Stage",
    "Value",
    "follow",
    "load_behaviour",
    "mock_world",
    "serve_play",
    "starter",
]
