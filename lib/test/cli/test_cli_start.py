"""Checking a model of a few situations loads nothing that only missions, or proofs over many situations, need."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

HEAVY = ("asyncio", "dd", "networkx", "urllib.request", "alula.check", "alula.missions", "alula.prove.mission", "alula.runtime")
"""What takes long to load."""
MODEL = "skillset small { resource lamp { state { OFF ON } initial OFF transition { OFF -> ON ON -> OFF } } }\n"
PROGRAM = """
import json, sys
from alula.cli import check
code = check.main([sys.argv[1]])
sys.stderr.write(json.dumps([code, sorted(sys.modules)]))
"""


def test_a_model_is_checked_and_proved_without_what_takes_long_to_load(tmp_path: Path) -> None:
    (tmp_path / "small.skill").write_text(MODEL, encoding="utf-8")
    words = [sys.executable, "-c", PROGRAM, str(tmp_path / "small.skill")]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert "ALU" in done.stdout, "the proofs have something to say of it"
    code, loaded = json.loads(done.stderr)
    assert code == 0
    assert "alula.prove.skillset.prover" in loaded
    assert [name for name in loaded if name.startswith(HEAVY)] == []
