"""``--console``: the operator's page of a run, as a process that lives as long as the run does."""

from __future__ import annotations

import os
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

TIMEOUT_S = 5.0  # wall clock, for the server to say goodbye to its viewers


@contextmanager
def console_page(out: Path, say: Callable[[str], None], command: tuple[str, ...] = ()) -> Iterator[None]:
    """Serve the page of the run in ``out`` while the context lasts, and say its address; a page that can't be served stops no flight."""
    root = Path(os.environ["ALULA_ROOT"])
    words = command or (str(root / "setup" / "in_ros2"), "python", "-m", "skill_panel.console", "--run", str(out))
    with (
        (out / "logs" / "console.log").open("wb") as log,
        # A session of its own, so that a Ctrl-C lands the vehicle and leaves the page.
        subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=log, text=True, start_new_session=True) as server,
    ):
        threading.Thread(target=_tell, args=(server, say), daemon=True).start()
        try:
            yield
        finally:
            server.terminate()
            try:
                server.wait(TIMEOUT_S)
            except subprocess.TimeoutExpired:
                server.kill()


def _tell(server: subprocess.Popen[str], say: Callable[[str], None]) -> None:
    address = server.stdout.readline().strip() if server.stdout is not None else ""
    say(f"the operator's page: {address}" if address else "the operator's page could not be served; logs/console.log says why")
