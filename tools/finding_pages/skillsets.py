"""Writes the findings of `skillsets/LANGUAGE.md` and `skillsets/PROOFS.md`: the part below its mark.

    python -m finding_pages.skillsets skillsets

The pages' text above that line is written by hand. Meanings come from `alula.language.codes`, examples from `examples.yaml` beside
the rules, and what `check` prints of an example is what it prints.
"""

from __future__ import annotations

import difflib
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from textwrap import dedent

from alula.common.files import write_text
from alula.common.generated import replaced
from alula.language import paper
from alula.language.codes import CODES, PROOF_CODES
from alula.language.errors import Diagnostic
from alula.language.models import ModelFile, check_texts
from alula.language.notation import Notation
from alula.language.printer import print_skillset
from alula.prove.skillset.prover import prove
from finding_pages.examples import LANGUAGE, PROOFS, Example, examples


def main() -> int:
    """Rewrite the pages in the folder that the command line names; return the exit code."""
    for name, findings in PAGES.items():
        path = Path(sys.argv[1]) / name
        write_text(path, page(path.read_text(encoding="utf-8"), findings))
    return 0


def page(text: str, findings: Callable[[str], str]) -> str:
    """Return a page with its findings replaced."""
    return replaced(text, "python -m finding_pages.skillsets skillsets", "the rules and their examples", findings(text).splitlines())


def language_findings(text: str) -> str:
    """Return the table of the findings of reading, checking and generating, and the page's skill in the other notation."""
    rows = (f"| {code} | {CODES[code]} | {_shown(example)} | {example.cure} |" for code, example in examples(LANGUAGE).items())
    return "\n".join(["| code | meaning | example | cure |", "|---|---|---|---|", *rows, "", *_translated(text)])


def _translated(text: str) -> Iterator[str]:
    """Yield the page's example of a skill as `check --to rl` prints it, without the skillset around it."""
    shown = next(model for model in re.findall(r"^```skill\n(.*?)^```", text, re.MULTILINE | re.DOTALL) if "\nskill " in model)
    printed = print_skillset(paper.parse(f"skillset page {{ {shown} }}"), Notation.ROBOT_LANGUAGE)
    types, _, inside = printed.partition("skillset page {\n")
    yield from (
        "## The skill in the Robot Language",
        "",
        "```rl",
        types.rstrip(),
        dedent(inside.rstrip().removesuffix("}")).rstrip(),
        "```",
    )


def _shown(example: Example) -> str:
    return f"`{example.broken}`" if example.broken else f"*{example.files}*"


def proof_findings(_text: str) -> str:
    """Return a section for each finding of the proofs: a model, what `check` says of it, and the lines that mend it."""
    known = examples(PROOFS)
    return "\n".join(line for code, meaning in PROOF_CODES.items() for line in _section(code, meaning, known[code]))


def _section(code: str, meaning: str, example: Example) -> Iterator[str]:
    yield f"### {code}: {meaning}\n"
    if example.broken:
        yield f"```rl\n{example.broken}\n```\n"
        yield f"```text\n{told(code, example.broken)}\n```\n"
    yield f"{example.cure}\n"
    if example.broken:
        yield f"```diff\n{_difference(example)}\n```\n"


def told(code: str, model: str) -> str:
    """Return the first finding of this code about a model, as `check` prints it."""
    finding = next(finding for finding in proved(model) if finding.code == code)
    head = f"{finding.severity.value} {code}: {finding.message}"
    return "\n".join([head, *(f"  {line}" for line in finding.counterexample_lines)])


def proved(model: str) -> list[Diagnostic]:
    """Return what the proofs find about a model that has no finding of the language."""
    (file,) = check_texts([ModelFile("example.rl", model)])
    return prove(file.skillsets[0])


def _difference(example: Example) -> str:
    """Return the lines that go and come between the broken and the mended model."""
    lines = difflib.ndiff(example.broken.splitlines(), example.mended.splitlines())
    return "\n".join(line for line in lines if line[0] in "+-")


PAGES: Mapping[str, Callable[[str], str]] = {"LANGUAGE.md": language_findings, "PROOFS.md": proof_findings}


if __name__ == "__main__":
    sys.exit(main())
