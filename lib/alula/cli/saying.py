"""What commands say on the standard error."""

from __future__ import annotations

import sys
from collections.abc import Callable


def warner(command: str) -> Callable[[str], None]:
    """Return what writes a line to the standard error, as the command's; ``command`` is what users type: ``alula check``."""

    def warn(line: str) -> None:
        sys.stderr.write(f"{command}: {line}\n")

    return warn
