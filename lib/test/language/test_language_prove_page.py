"""PROOFS.md: each example triggers its code as printed, and its mended twin does not."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from alula.commands.check import main
from alula.language.codes import PROOF_CODES
from alula.language.errors import Severity, has_errors
from alula.language.models import check_files
from alula.language.notation import Notation, read
from alula.language.printer import print_file
from alula.prove import prove

PAGE = next(p / "skillsets" / "PROOFS.md" for p in Path(__file__).resolve().parents if (p / "skillsets" / "PROOFS.md").exists())
SECTION = re.compile(r"^### (ALU\d+): (.*?)\n(.*?)(?=^### |\Z)", re.MULTILINE | re.DOTALL)
BLOCK = re.compile(r"```(\w+)\n(.*?)```", re.DOTALL)
SECTIONS = {code: (title, BLOCK.findall(body)) for code, title, body in SECTION.findall(PAGE.read_text())}
WITH_EXAMPLE = sorted(set(PROOF_CODES) - {"ALU540"})


def proved(tmp_path, text, **options):
    path = tmp_path / "example.rl"
    path.write_text(text)
    (file,) = check_files([path])
    assert not has_errors(file.findings), file.findings
    (skillset,) = file.skillsets
    return prove(skillset, **options)


def test_the_page_has_every_code_by_its_meaning():
    assert {code: title for code, (title, _) in SECTIONS.items()} == PROOF_CODES


@pytest.mark.parametrize("most", [2000, 0], ids=["one by one", "as sets"])
@pytest.mark.parametrize("code", WITH_EXAMPLE)
def test_example_and_mended_twin(code, most, tmp_path):
    (kind, broken), (_, printed), (_, mended) = SECTIONS[code][1]
    assert kind == "rl"
    shown = [f for f in proved(tmp_path, broken, most=most) if f.code == code]
    if most:
        first = shown[0]
        told = [f"{first.severity.value} {code}: {first.message}", *(f"  {line}" for line in first.counterexample_lines)]
        assert "\n".join(told) == printed.strip()
    assert shown
    assert all(finding.span.line for finding in shown)
    assert proved(tmp_path, mended, most=most) == []


@pytest.mark.parametrize("code", WITH_EXAMPLE)
def test_the_same_is_found_in_the_papers_notation(code, tmp_path):
    (_, broken), _, (_, mended) = SECTIONS[code][1]
    for text in (broken, mended):
        document, source = read(text, "example.rl")
        assert source.diagnostics == []
        path = tmp_path / "example.skill"
        path.write_text(print_file(document.skillsets, Notation.PAPER, []))
        (file,) = check_files([path])
        assert not has_errors(file.findings), file.findings
        assert {f.code for f in prove(file.skillsets[0])} == {f.code for f in proved(tmp_path, text)}


def test_time_is_bounded_and_said(tmp_path):
    broken = SECTIONS["ALU531"][1][0][1]
    findings = proved(tmp_path, broken, timeout_s=0.0)
    assert [(f.code, f.severity) for f in findings if f.code == "ALU540"] == [("ALU540", Severity.ERROR)]
    without = SECTIONS["ALU510"][1][2][1]
    assert [(f.code, f.severity) for f in proved(tmp_path, without, timeout_s=0.0)] == [("ALU540", Severity.WARNING)]


def test_strict_makes_errors_of_warnings(tmp_path):
    path = tmp_path / "example.rl"
    path.write_text(SECTIONS["ALU522"][1][0][1])
    assert [main([str(path), *options]) for options in ((), ("--strict",))] == [0, 1]
