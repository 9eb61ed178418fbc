"""The examples of findings: `examples.yaml` beside the rules of a package has a broken and a mended model of each code."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources

import yaml


@dataclass(frozen=True)
class Example:
    """How a finding comes about, and how it is mended."""

    cure: str
    broken: str = ""
    """A model in the Robot Language whose check gives the finding; empty where only files show it."""
    mended: str = ""
    """The model after the cure, without any finding."""
    files: str = ""
    """What is wrong with files, where no text of one model shows it."""


def examples(package: str) -> Mapping[str, Example]:
    """Return the examples of a package by their codes, in the order of its file."""
    text = resources.files(package).joinpath("examples.yaml").read_text(encoding="utf-8")
    return {code: Example(**entry) for code, entry in yaml.safe_load(text).items()}


LANGUAGE = "alula.language"
PROOFS = "alula.prove.skillset"
MISSIONS = "alula.check"
RUNS = "alula.prove.mission"
"""The packages that have examples."""
