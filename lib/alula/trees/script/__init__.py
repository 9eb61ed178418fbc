"""BehaviorTree.CPP 4's scripting language: `a := b + 1; c == RED && d > 2`.

Extensions of ours: dotted names (``navigation.flight_status == IN_AIR``) and calls (``running(navigation.goto)``).
"""

from alula.trees.script.errors import ScriptError
from alula.trees.script.parser import parse, statements_of
from alula.trees.script.program import Names, Note, Program, names_in
from alula.trees.script.scope import Reference, Scope, Value
from alula.trees.script.values import truth

__all__ = ["Names", "Note", "Program", "Reference", "Scope", "ScriptError", "Value", "names_in", "parse", "statements_of", "truth"]
