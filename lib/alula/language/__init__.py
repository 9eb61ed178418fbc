"""The skill language: what a robot can do, as plain values that were read, checked and can be generated from.

``load`` reads files, ``check`` judges a model, ``printer`` writes it, ``generate`` makes ROS packages of
it. Nothing in this package imports ROS.
"""

from alula.language.errors import Diagnostic, LanguageError, Severity
from alula.language.load import load_robot, load_skillset
from alula.language.notation import Notation
from alula.language.printer import print_skillset

__all__ = [
    "Diagnostic",
    "LanguageError",
    "Notation",
    "Severity",
    "load_robot",
    "load_skillset",
    "print_skillset",
]
