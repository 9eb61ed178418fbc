"""Writes the findings of docs/reference/mission-checks.md: the part below its mark.

python -m finding_pages.mission_checks docs/reference
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from alula.check.findings import findings_of
from alula.common.files import write_text
from alula.common.generated import replaced
from alula.language.codes import MISSION_CODES
from alula.language.errors import Diagnostic
from alula.language.models import ModelFile, check_texts
from finding_pages.examples import MISSIONS, Example, examples

NAME = "mission-checks.md"
ROBOT = """
skillset drone {
  resource axes { state { FREE USED } initial FREE transition { FREE -> USED USED -> FREE } }
  resource flight { state { ON_GROUND IN_AIR } initial ON_GROUND transition { extern ON_GROUND -> IN_AIR extern IN_AIR -> ON_GROUND } }
  skill hover {
    input {
      duration: float64 // s
    }
    precondition free: axes == FREE
    start axes -> USED
    interrupt { effect axes -> FREE }
    success DONE { effect axes -> FREE }
    failure ABORTED { effect axes -> FREE }
  }
  skill turn {
    input {
      angle: float64 // rad
    }
    precondition free: axes == FREE
    start axes -> USED
    interrupt { effect axes -> FREE }
    success DONE { effect axes -> FREE }
  }
  skill watch {
    failure LOST {}
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
    known = examples(MISSIONS)
    sections = (line for code, meaning in MISSION_CODES.items() for line in _section(code, meaning, known[code]))
    return replaced(text, "python -m finding_pages.mission_checks docs/reference", "the rules and their examples", sections)


def _section(code: str, meaning: str, example: Example) -> Iterator[str]:
    yield f"### {code}: {meaning}\n"
    if example.files:
        yield f"Found in: {example.files}.\n"
    else:
        finding = next(one for one in found_in(example.broken) if one.code == code)
        yield f"```xml\n{example.broken}\n```\n"
        told = [f"{finding.severity.value} {code}: {finding.message}", *([f"  = hint: {finding.hint}"] if finding.hint else [])]
        yield "```text\n" + "\n".join(told) + "\n```\n"
    yield f"{example.cure[:1].upper()}{example.cure[1:]}.\n"
    if example.mended:
        yield f"```xml\n{example.mended}\n```\n"


def whole(text: str) -> str:
    """Return the file of an example, which may be one node of the main tree."""
    inside = "\n".join(f"    {line}" for line in text.split("\n"))
    wrapped = f'<root BTCPP_format="4">\n  <BehaviorTree ID="mission">\n{inside}\n  </BehaviorTree>\n</root>\n'
    return text if text.startswith("<root") else wrapped


def found_in(text: str) -> list[Diagnostic]:
    """Return the findings about an example."""
    (robot,) = check_texts([ModelFile("robot.rl", ROBOT)])
    return findings_of("example.xml", whole(text).encode(), robot.skillsets)


if __name__ == "__main__":
    sys.exit(main())
