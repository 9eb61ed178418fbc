"""What a stranger's tools read first: addresses in manifests, and the workflow of a forge."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
import yaml

ALULA_ROOT = Path(__file__).resolve().parents[1]
ADDRESS = re.compile(r"[\w.+-]+@([\w-]+(?:\.[\w-]+)+)")
EXAMPLE = re.compile(r"(.+\.)?example\.(org|com|net)")
"""The domains that nobody can own (RFC 2606)."""


def tracked(*patterns: str) -> list[Path]:
    listed = subprocess.run(["git", "ls-files", "-z", *patterns], cwd=ALULA_ROOT, capture_output=True, text=True, check=True).stdout
    return [ALULA_ROOT / name for name in listed.split("\0") if name]


@pytest.mark.skipif(not (ALULA_ROOT / ".git").exists(), reason="which files are Alula's, a checkout knows")
def test_no_manifest_has_an_address_that_may_be_a_strangers() -> None:
    manifests = tracked("*package.xml", "*package.xml.in", "*pyproject.toml", "*setup.py", "lib/alula/generate/*.py")
    found = {(path.name, domain) for path in manifests for domain in ADDRESS.findall(path.read_text(encoding="utf-8"))}
    assert found, "ROS requires an address in every package.xml"
    assert not {(name, domain) for name, domain in found if not EXAMPLE.fullmatch(domain)}


def test_a_forge_runs_what_everybody_runs() -> None:
    workflow = yaml.safe_load((ALULA_ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8"))
    runs = [step["run"] for step in workflow["jobs"]["suite"]["steps"] if "run" in step]
    assert runs[-1] == ".ci/run"
    assert (ALULA_ROOT / ".ci/run").stat().st_mode & 0o111
