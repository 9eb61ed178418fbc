"""The skill language: what a robot can do, as plain values that were read, checked and can be generated from.

``load`` reads files, ``check`` judges a model, ``printer`` writes it, ``generate`` makes ROS packages of
it. Nothing in this package imports ROS.
"""

from skill_language.errors import Diagnostic, LanguageError, Severity
from skill_language.load import load_robot, load_skillset
from skill_language.notation import Notation
from skill_language.printer import print_skillset

__all__ = [
    "Diagnostic",
    "LanguageError",
    "Notation",
    "Severity",
    "load_robot",
    "load_skillset",
    "print_skillset",
]
