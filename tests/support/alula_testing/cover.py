"""Commands that work on the checkout and leave it as it is."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

ALULA_ROOT = Path(__file__).resolve().parents[3]
# Runs what follows in a mount namespace of its own, where the checkout is covered by a layer that takes every change.
COVER = 'mount -t overlay overlay -o "lowerdir=$1,upperdir=$2/upper,workdir=$2/work" "$1" && cd "$1" && shift 2 && exec "$@"'
# The same, where the checkout and what is mounted in it can't be written to.
READ_ONLY = """mount --make-rprivate / && mount --rbind "$1" "$1" || exit
for place in $(awk -v root="$1" '$2 == root || index($2, root "/") == 1 {print $2}' /proc/mounts | sort -u); do
  mount -o remount,bind,ro "$place" || exit
done
shift && exec "$@\""""


def read_only() -> list[str]:
    """Return the words before a command that has it find the checkout as one that can't be written to, also not by root."""
    for rights in ([], ["--map-root-user"]):
        words = ["unshare", "--mount", *rights, "sh", "-c", READ_ONLY, "sh", str(ALULA_ROOT)]
        if subprocess.run([*words, "true"], capture_output=True, check=False).returncode == 0:
            return words
    pytest.skip("this machine allows no mounts, not even in a user namespace")


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
