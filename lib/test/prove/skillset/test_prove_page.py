"""The examples of the proofs: each broken model has its finding, each mended one none, and PROOFS.md is written of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from alula.cli.check import main
from alula.language.codes import PROOF_CODES
from alula.language.errors import Severity, has_errors
from alula.language.models import check_files
from alula.language.notation import Notation, read
from alula.language.printer import print_file
from alula.prove.skillset.prover import prove
from finding_pages.examples import PROOFS, examples
from finding_pages.skillsets import PAGES, page

FOLDER = next(p / "skillsets" for p in Path(__file__).resolve().parents if (p / "skillsets" / "PROOFS.md").exists())
EXAMPLES = examples(PROOFS)
WITH_MODEL = sorted(set(PROOF_CODES) - {"ALU540"})


def proved(tmp_path, text, **options):
    path = tmp_path / "example.rl"
    path.write_text(text)
    (file,) = check_files([path])
    assert not has_errors(file.findings), file.findings
    (skillset,) = file.skillsets
    return prove(skillset, **options)


@pytest.mark.parametrize("name", PAGES)
def test_the_pages_are_written_of_rules_and_examples(name):
    """Mend with `python -m finding_pages.skillsets skillsets`."""
    text = (FOLDER / name).read_text()
    assert text == page(text, PAGES[name])


def test_each_code_has_an_example():
    assert set(EXAMPLES) == set(PROOF_CODES)
    assert sorted(code for code, example in EXAMPLES.items() if example.broken and example.mended) == WITH_MODEL
    assert all(example.cure for example in EXAMPLES.values())


@pytest.mark.parametrize("most", [2000, 0], ids=["one by one", "as sets"])
@pytest.mark.parametrize("code", WITH_MODEL)
def test_broken_and_mended_model(code, most, tmp_path):
    shown = [f for f in proved(tmp_path, EXAMPLES[code].broken, most=most) if f.code == code]
    assert shown
    assert all(finding.span.line for finding in shown)
    assert proved(tmp_path, EXAMPLES[code].mended, most=most) == []


@pytest.mark.parametrize("code", WITH_MODEL)
def test_the_same_is_found_in_the_papers_notation(code, tmp_path):
    for text in (EXAMPLES[code].broken, EXAMPLES[code].mended):
        document, source = read(text, "example.rl")
        assert source.diagnostics == []
        path = tmp_path / "example.skill"
        path.write_text(print_file(document.skillsets, Notation.PAPER, []))
        (file,) = check_files([path])
        assert not has_errors(file.findings), file.findings
        assert {f.code for f in prove(file.skillsets[0])} == {f.code for f in proved(tmp_path, text)}


def test_time_is_bounded_and_said(tmp_path):
    broken = EXAMPLES["ALU531"].broken
    findings = proved(tmp_path, broken, timeout_s=0.0)
    assert [(f.code, f.severity) for f in findings if f.code == "ALU540"] == [("ALU540", Severity.ERROR)]
    without = EXAMPLES["ALU510"].mended
    assert [(f.code, f.severity) for f in proved(tmp_path, without, timeout_s=0.0)] == [("ALU540", Severity.WARNING)]


def test_strict_makes_errors_of_warnings(tmp_path):
    path = tmp_path / "example.rl"
    path.write_text(EXAMPLES["ALU522"].broken)
    assert [main([str(path), *options]) for options in ((), ("--strict",))] == [0, 1]
