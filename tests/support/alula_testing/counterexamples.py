"""Counterexamples of the proofs: those of its examples, a model with data and time, and one with transitions from outside."""

from __future__ import annotations

from pathlib import Path

from alula.language.errors import Diagnostic
from alula.language.models import check_files
from alula.model.model import Skillset
from alula.prove.skillset.prover import prove
from finding_pages.examples import PROOFS, examples

EXAMPLES = {code: example.broken for code, example in examples(PROOFS).items() if example.broken}
DATA = """
skillset watch {
  data fps: float64 period 1 sec
  data battery: Battery
  type Battery
  resource eyes { state { Shut Open } initial Shut transition { Shut -> Open  Open -> Shut } }
  skill look {
    precondition { sees: fps >= 10  shut: eyes == Shut }
    start eyes -> Open
    invariant {
      sees { guard fps >= 10 recovers at 12 effect eyes -> Shut }
      power { guard battery.level > 20 % for 3 s }
    }
    progress { period 1 sec deadline 2 sec }
    interrupt { effect eyes -> Shut }
    success DONE { effect eyes -> Shut }
  }
  property shut: never eyes == Open
}
"""
OUTSIDE = """
skillset uav {
  resource authority { state { Pilot Drone } initial Pilot transition { Pilot -> Drone  Drone -> Pilot } }
  type Point
  skill goto {
    input { target: Point  speed: float64  fast: bool }
    output { reached: float64 }
    precondition { a: authority == Drone }
    success arrived
  }
  property ends: goto running leads to authority == Pilot
  property no: never goto running
}
"""
MODELS = {**EXAMPLES, "data and time": DATA, "from outside": OUTSIDE}


def counterexamples(path: Path, text: str) -> tuple[Skillset, list[Diagnostic]]:
    """Return the skillset of a model, written to ``path``, and the findings that have a counterexample with steps."""
    path.write_text(text)
    (file,) = check_files([path])
    (skillset,) = file.skillsets
    return skillset, [finding for finding in prove(skillset) if finding.counterexample.steps]
