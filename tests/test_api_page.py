"""docs/reference/api.md is what the docstrings say, and has every public name."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from api_page.__main__ import MODULES, PAGE, _offered, _parsed, page

ALULA_ROOT = Path(__file__).resolve().parents[1]


def test_the_page_is_current() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "write it again: PYTHONPATH=tools setup/in_ros2 python -m api_page"


def test_every_public_name_is_told_of() -> None:
    sections = dict(re.findall(r"^## ([\w.]+)\n(.*?)(?=^## |\Z)", page(), re.MULTILINE | re.DOTALL))
    assert tuple(sections) == MODULES
    for module, text in sections.items():
        told = set(re.findall(r"^### (\w+)$", text, re.MULTILINE)) | set(re.findall(r"`(\w+)`[,.]", text.partition("### Values")[2]))
        assert told - {"Values"} == {name for name, _ in _offered(_parsed(module))}
        for name, entry in re.findall(r"^### (\w+)\n\n(.*?)(?=^### |\Z)", text, re.MULTILINE | re.DOTALL):
            assert name == "Values" or entry.strip(), f"{module}.{name} has no docstring"


def test_lines_of_code_in_the_page_parse() -> None:
    blocks = re.findall(r"(?:^ {4}\S.*\n(?:^(?: {4}.*)?\n)*)+", page(), re.MULTILINE)
    programs = [block for block in blocks if "import" in block or "@register" in block]
    assert len(programs) >= 2
    for program in programs:
        ast.parse(re.sub(r"^ {4}", "", program, flags=re.MULTILINE))


def test_what_a_public_class_has_of_a_private_base_is_told_once() -> None:
    """The clients of both ROS worlds derive from one class; hooks are called by managers, so that of their bases only attributes count."""
    text = page()
    assert text.count("- `start(skill: str, **inputs: object) -> SkillHandle`: ") == 1
    assert "\nIt has what [SkillsetClient](#skillsetclient) has.\n" in text
    assert text.count("- `answer_s`: ") == 2
    assert "`waited_s(" not in text
