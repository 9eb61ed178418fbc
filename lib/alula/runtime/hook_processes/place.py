"""Where the pipe of a skillset is, and what crosses it."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from alula.model.execution_state import ExecutionState
from alula.runtime.core.execution import Execution


def pipe_address(*names: str) -> str:
    """Return the path of a socket for a skillset that is named by domain, namespace and name; only this user may enter its folder."""
    folder = Path(os.environ.get("XDG_RUNTIME_DIR", tempfile.gettempdir())) / f"alula-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    if folder.stat().st_uid != os.getuid() or folder.stat().st_mode & 0o077:
        raise PermissionError(f"{folder} can be entered by others; remove it")
    return str(folder / f"{hashlib.sha256('|'.join(names).encode()).hexdigest()[:24]}.sock")


@dataclass(frozen=True)
class Snapshot:
    """An execution at one moment."""

    id: str
    inputs: object
    state: ExecutionState
    result: str
    message: str
    outputs: Mapping[str, object]
    progress: float


def snapshot(execution: Execution) -> Snapshot:
    """Return an execution as it is now."""
    outputs = dict(execution.outputs)
    return Snapshot(execution.id, execution.inputs, execution.state, execution.result, execution.message, outputs, execution.progress)
