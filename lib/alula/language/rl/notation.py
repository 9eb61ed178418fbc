"""The Robot Language as a whole: its skills, and conditions without words around them."""

from __future__ import annotations

from alula.language.lexer import Source
from alula.language.rl.skill import read_skill
from alula.language.syntax.conditions import bare_condition
from alula.language.syntax.document import Dialect, one_skillset, read_document
from alula.model.model import Skillset

ROBOT_LANGUAGE = Dialect(read_skill, bare_condition)


def parse(text: str, file: str = "") -> Skillset:
    """Return the only skillset written in ``text``; raise LanguageError with everything that is wrong with the notation."""
    source = Source(file, text)
    return one_skillset(source, read_document(source, ROBOT_LANGUAGE))
