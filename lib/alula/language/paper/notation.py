"""The paper's notation as a whole: its skills, and conditions that say what they ask (`resource = (...)`)."""

from __future__ import annotations

from alula.language.lexer import Source
from alula.language.paper.skill import read_skill
from alula.language.syntax.conditions import paper_condition
from alula.language.syntax.document import Dialect, one_skillset, read_document
from alula.model.model import Skillset

PAPER = Dialect(read_skill, paper_condition)


def parse(text: str, file: str = "") -> Skillset:
    """Return the only skillset written in ``text``.

    Raises:
        LanguageError: with everything that is wrong with the notation. Meaning is judged by ``check``, except that an
            effect that is referred to must exist, for else there is nothing to put into the model.
    """
    source = Source(file, text)
    return one_skillset(source, read_document(source, PAPER))
