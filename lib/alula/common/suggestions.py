"""Hints for a name that is not known; ``python -m alula.common.suggestions NAME KNOWN...`` prints one."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Iterable, Sequence

_FEW = 8
_SHORT = 5
"""In a name of fewer letters two slips weigh more: ``flie`` for fly."""
_MANY = 500
"""More names than this are not looked through for a hint: it has to come at once."""


def nearest(name: str, known: Iterable[str]) -> str:
    """Return a hint that names the known name nearest to this one, or lists the few there are, or is empty."""
    candidates = sorted(set(known))[:_MANY]
    # Names are compared without case: AVAILABLE for available is the commonest slip.
    folded: dict[str, str] = {}
    for candidate in candidates:
        folded.setdefault(candidate.lower(), candidate)
    cutoff = 0.55 if len(name) < _SHORT else 0.6
    match = difflib.get_close_matches(name.lower()[:80], folded, n=1, cutoff=cutoff)
    if match:
        return f"did you mean `{folded[match[0]]}`?"
    if 0 < len(candidates) <= _FEW:
        return f"there is {quoted(candidates)}"
    return ""


def with_nearest(message: str, name: str, known: Iterable[str]) -> str:
    """Return a message about a name that is not known, with the hint of `nearest` behind it where there is one."""
    hint = nearest(name, known)
    return f"{message}; {hint}" if hint else message


def quoted(names: Sequence[str]) -> str:
    """Return names in backquotes, comma separated."""
    return ", ".join(f"`{name}`" for name in names)


if __name__ == "__main__":
    sys.stdout.write(nearest(sys.argv[1], sys.argv[2:]))
