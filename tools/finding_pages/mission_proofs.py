"""Writes the findings of docs/reference/mission-proofs.md: the part below its mark.

python -m finding_pages.mission_proofs docs/reference
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from alula.common.files import write_text
from alula.common.generated import replaced
from alula.language.codes import RUN_CODES
from alula.language.errors import Diagnostic
from alula.language.models import ModelFile, check_texts
from alula.missions.mission_file import MissionFile
from alula.missions.part import NO_PART
from alula.prove.mission.prover import prove_mission
from finding_pages.examples import RUNS, Example, examples
from finding_pages.mission_checks import whole

NAME = "mission-proofs.md"
ROBOT = """
skillset drone {
  resource control { state { OURS THEIRS } initial OURS transition { extern OURS -> THEIRS  extern THEIRS -> OURS } }
  resource axes { state { FREE USED } initial FREE transition { FREE -> USED USED -> FREE } }
  skill climb {
    precondition free: axes == FREE
    start axes -> USED
    invariant { ours { guard control == OURS } }
    interrupt { effect axes -> FREE }
    success DONE { effect axes -> FREE }
  }
  skill lift {
    precondition free: axes == FREE
    start axes -> USED
    invariant { ours { guard control == OURS effect axes -> FREE } }
    interrupt { effect axes -> FREE }
    success DONE { effect axes -> FREE }
  }
  skill hover {
    precondition free: axes == FREE
    start axes -> USED
    interrupt { effect axes -> FREE }
    success DONE { effect axes -> FREE }
    failure ABORTED { effect axes -> FREE }
  }
  skill land {
    precondition free: axes == FREE
    start axes -> USED
    interrupt { effect axes -> FREE }
    success DONE { effect axes -> FREE }
  }
}
"""
"""The robot of the examples."""


def main() -> int:
    """Rewrite the page in the folder that the command line names; return the exit code."""
    path = Path(sys.argv[1]) / NAME
    write_text(path, page(path.read_text(encoding="utf-8")))
    return 0


def page(text: str) -> str:
    """Return the page with its findings replaced."""
    known = examples(RUNS)
    sections = (line for code, meaning in RUN_CODES.items() for line in _section(code, meaning, known[code]))
    return replaced(text, "python -m finding_pages.mission_proofs docs/reference", "the rules and their examples", sections)


def found_in(text: str) -> list[Diagnostic]:
    """Return the findings about the runs of an example."""
    (robot,) = check_texts([ModelFile("robot.rl", ROBOT)])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "example.xml"
        path.write_text(whole(text), encoding="utf-8")
        return prove_mission(MissionFile.read(path, robot.skillsets, NO_PART)).findings


def _section(code: str, meaning: str, example: Example) -> Iterator[str]:
    yield f"### {code}: {meaning}\n"
    if example.files:
        yield f"Found in: {example.files}.\n"
    else:
        finding = next(one for one in found_in(example.broken) if one.code == code)
        yield f"```xml\n{example.broken}\n```\n"
        told = [f"{finding.severity.value} {code}: {finding.message}", *(f"  {line}" for line in finding.example)]
        yield "```text\n" + "\n".join(told) + "\n```\n"
    yield f"{example.cure[:1].upper()}{example.cure[1:]}.\n"
    if example.mended:
        yield f"```xml\n{example.mended}\n```\n"


if __name__ == "__main__":
    sys.exit(main())
