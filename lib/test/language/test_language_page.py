"""LANGUAGE.md tells the truth: its examples are models, the two notations in it the same ones, and each finding comes as told."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from alula.language import paper, rl
from alula.language.check import check
from alula.language.codes import CODES, MISSION_CODES, PROOF_CODES, RUN_CODES
from alula.language.models import ModelFile, check_texts
from alula.language.syntax.quantities import SECONDS
from alula.model.json_form import to_json
from alula.model.model import NO_EFFECT
from alula.model.units import UNIT_IN_SI
from finding_pages.examples import LANGUAGE, examples

PAGE = next(p / "skillsets" / "LANGUAGE.md" for p in Path(__file__).resolve().parents if (p / "skillsets").is_dir()).read_text()
PAPER = [paper.parse(f"skillset page {{ {text} }}") for text in re.findall(r"```skill\n(.*?)```", PAGE, re.DOTALL)]
TEXTS_RL = re.findall(r"```rl\n(.*?)```", PAGE, re.DOTALL)
EXAMPLES = examples(LANGUAGE)


def test_every_example_is_sound():
    assert len(PAPER) == 3
    assert len(TEXTS_RL) == 2
    for example in PAPER:
        assert check(example) == []


def test_both_notations_of_an_example_are_one_model():
    assert to_json(rl.parse(f"skillset page {{ {TEXTS_RL[1]} }}")) == to_json(PAPER[1])
    assert PAPER[1].skill("goto").start != NO_EFFECT


def test_names_across_files(tmp_path):
    first, second = TEXTS_RL[0].split("// navigation.rl\n")
    (tmp_path / "types.rl").write_text(first)
    file = ModelFile(str(tmp_path / "navigation.rl"), second)
    assert [finding.code for finding in check_texts([file])[0].findings] == []
    assert file.skillsets[0].types == ("Point",)
    (tmp_path / "types.rl").unlink()
    lonely = check_texts([ModelFile(str(tmp_path / "navigation.rl"), second)])[0]
    assert sorted(finding.code for finding in lonely.findings) == ["ALU205", "ALU224"]


def test_all_units_are_told():
    (told,) = re.findall(r"A number may have a unit: `(.*?)`", " ".join(PAGE.split()))
    assert set(told.split()) == set(UNIT_IN_SI) - {""}
    (told,) = re.findall(r"Durations are in `(.*?)`", " ".join(PAGE.split()))
    assert set(told.split()) == set(SECONDS)


def test_each_code_has_an_example():
    assert set(EXAMPLES) == set(CODES) - set(PROOF_CODES) - set(MISSION_CODES) - set(RUN_CODES)
    assert all(example.cure and bool(example.broken) != bool(example.files) for example in EXAMPLES.values())


@pytest.mark.parametrize("code", [code for code, example in EXAMPLES.items() if example.broken])
def test_broken_and_mended_model(code):
    (broken,) = check_texts([ModelFile("example.rl", EXAMPLES[code].broken)])
    assert code in [finding.code for finding in broken.findings]
    assert len(broken.findings) <= 3
    (mended,) = check_texts([ModelFile("example.rl", EXAMPLES[code].mended)])
    assert mended.skillsets
    assert mended.findings == []
