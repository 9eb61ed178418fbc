"""Commands that work on the checkout and leave it as it is."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

ALULA_ROOT = Path(__file__).resolve().parents[3]
# Runs what follows in a mount namespace of its own, where the checkout is covered by a layer that takes every change.
COVER = 'mount -t overlay overlay -o "lowerdir=$1,upperdir=$2/upper,workdir=$2/work" "$1" && cd "$1" && shift 2 && exec "$@"'


def cover(folder: Path) -> list[str]:
    """Return the words before a command that has it work on the checkout and leave the checkout as it is, also what was built.

    Mounting needs a mount namespace: root's own, or one of a user namespace. A machine that allows neither skips the test: without
    the layer everything would have to be set up again.
    """
    layer = folder / "layer"
    for name in ("upper", "work"):
        (layer / name).mkdir(parents=True)
    for rights in ([], ["--map-root-user"]):
        covered = ["unshare", "--mount", *rights, "sh", "-c", COVER, "sh", str(ALULA_ROOT), str(layer)]
        if subprocess.run([*covered, "true"], capture_output=True, check=False).returncode == 0:
            return covered
    pytest.skip("this machine allows no overlay mount, not even in a user namespace")
