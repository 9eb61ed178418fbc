"""What is wrong with a script, and where in its text."""

from __future__ import annotations

from alula.common.errors import AlulaError


class ScriptError(AlulaError):
    """A script that can't be read, or that fails as it runs.

    ``offset`` counts characters from the script's begin, 0-based; ``end`` is exclusive. ``excess``: it is longer or deeper than any
    script may be. ``str()`` is one line.
    """

    def __init__(self, message: str, offset: int = 0, *, end: int | None = None, cure: str = "", excess: bool = False) -> None:
        self.message = message
        self.offset = offset
        self.end = offset + 1 if end is None else max(end, offset + 1)
        self.cure = cure
        self.excess = excess
        super().__init__(f"{message} (character {offset + 1} of the script)" + (f"; {cure}" if cure else ""))
