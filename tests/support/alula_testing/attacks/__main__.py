"""``python -m alula_testing.attacks ros1|ros2``: see the package."""

from __future__ import annotations

import os
import sys
import traceback

from alula_testing.attacks.attacks import ATTACKS
from alula_testing.attacks.graph import answer
from alula_testing.attacks.worlds import WORLDS


def main() -> None:
    """Attack until stdin ends."""
    # Whatever prints to stdout goes to stderr: that line belongs to the answers.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    with WORLDS[sys.argv[1]]() as graph:
        for line in sys.stdin:
            try:
                found = ATTACKS[line.strip()](graph)
            except Exception as error:  # noqa: BLE001 - the test must hear of it
                found = {"error": "".join(traceback.format_exception(error))}
            answers.write(answer(found))
            answers.flush()


if __name__ == "__main__":
    main()
