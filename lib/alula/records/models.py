"""The models that a log is about: those that the managers execute, or others from files."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Iterable, Sequence
from pathlib import Path

from alula.language.errors import LanguageError
from alula.language.load import load_skillset
from alula.model.model import Skillset
from alula.records.errors import AnalysisError


def models_of(names: Iterable[str], files: Sequence[Path] = ()) -> list[Skillset]:
    """Return a model for each skillset: that of a file, else the one that its generated managers execute.

    Raises:
        AnalysisError: a file has errors, or there is no model of a skillset.
    """
    given = {}
    for file in files:
        try:
            skillset = load_skillset(file)
        except LanguageError as error:
            raise AnalysisError(str(error)) from None
        given[skillset.name] = skillset
    return [given[name] if name in given else _generated(name) for name in names]


def _generated(name: str) -> Skillset:
    module = f"{name}_managers.model"
    if not name.isidentifier() or importlib.util.find_spec(module.partition(".")[0]) is None:
        raise AnalysisError(f"there is no model of skillset {name!r} in this checkout; give its file with --model")
    skillset: Skillset = importlib.import_module(module).SKILLSET
    return skillset
