"""The library under each Python that it promises: its wheel installed into an empty environment, its units, a mission and a proof."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ALULA_ROOT = Path(__file__).resolve().parents[1]
PROMISED = re.findall(r"Python :: (3\.\d+)", (ALULA_ROOT / "lib/pyproject.toml").read_text(encoding="utf-8"))
HERE = f"{sys.version_info.major}.{sys.version_info.minor}"
UNITS = ["lib/test/model", "lib/test/runtime/test_runtime_handle.py", "lib/test/trees"]
PYENV = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))


def interpreter(version: str) -> Path | None:
    """Return the interpreter of a version, as the path or pyenv has it."""
    on_path = shutil.which(f"python{version}")
    if on_path and Path(on_path).resolve().name != "pyenv" and ".pyenv/shims" not in on_path:
        return Path(on_path)
    return next(iter(sorted(PYENV.glob(f"versions/{version}.*/bin/python{version}"))), None)


def run(*words: str | Path, cwd: Path = ALULA_ROOT, environment: dict[str, str] | None = None) -> str:
    done = subprocess.run([str(word) for word in words], cwd=cwd, env=environment, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, f"{words}: {done.stdout[-3000:]}{done.stderr[-3000:]}"
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the source distribution, and the wheel of it, as a release does."""
    place = tmp_path_factory.mktemp("release")
    source = shutil.copytree(ALULA_ROOT / "lib", place / "lib", ignore=shutil.ignore_patterns("__pycache__", "*.egg-info", "build", "test"))
    run(sys.executable, "-m", "build", "--outdir", place / "dist", source)
    return next((place / "dist").glob("*.whl"))


@pytest.mark.parametrize("version", [version for version in PROMISED if version != HERE])
def test_the_library_runs_under(version: str, wheel: Path, tmp_path: Path) -> None:
    python = interpreter(version)
    if python is None:
        pytest.skip(f"there is no python{version} on this machine")
    inherited = {
        name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "ROS", "AMENT", "ALULA", "LD_", "COLCON"))
    }
    run(python, "-m", "venv", tmp_path / "venv", environment=inherited)
    own = tmp_path / "venv/bin"
    needed = [f"{wheel}[prove,groot,console]", "pytest", "pytest-timeout", "hypothesis", "behaviortreepy==0.1.4"]
    run(own / "pip", "--disable-pip-version-check", "install", "--quiet", "--no-compile", *needed, environment=inherited)
    supporting = {
        **inherited,
        "PYTHONPATH": str(ALULA_ROOT / "tests/support"),
        "ALULA_ROOT": str(ALULA_ROOT),
        "ALULA_ROBOT": str(ALULA_ROOT),
    }
    units = ("-m", "pytest", "-q", "-c", "tests/pytest.ini", "--rootdir", ALULA_ROOT, "-p", "no:cacheprovider", "-p", "alula_testing.quick")
    assert run(own / "python", *units, *UNITS, environment=supporting).count(".") > 200
    bare = {"PATH": "/usr/bin:/bin", "LANG": "C.UTF-8", "HOME": str(tmp_path), "MPLCONFIGDIR": str(tmp_path)}
    flown = run(own / "alula", "run", "mapping", "--mock", "--fail", "zed@30", "--out", tmp_path / "run", environment=bare)
    assert "mission accomplished in degraded mode" in flown
    assert (tmp_path / "run/report.html").stat().st_size > 1000
    proved = run(own / "alula", "check", "skillsets/uav/perception.skill", environment=bare)
    assert proved.endswith("perception.skill: ok\n")
