"""The address of a skillset's pipe, the key to it, and what crosses it."""

from __future__ import annotations

import contextlib
import hashlib
import os
import pickle
import secrets
import socket
import stat
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from multiprocessing.connection import Connection, answer_challenge, deliver_challenge
from pathlib import Path
from typing import Any

from alula.model.execution_state import ExecutionState
from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.core.execution import Execution

KEY_BYTES = 32


def pipe_address(*names: str) -> str:
    """Return the path of a socket for a skillset that is named by domain, namespace and name; only this user may enter its folder.

    Raises:
        SkillRuntimeError: the folder can't be made, or is not this user's alone.
    """
    folder = Path(os.environ.get("XDG_RUNTIME_DIR", tempfile.gettempdir())) / f"alula-{os.getuid()}"
    try:
        with contextlib.suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        _check_private(folder, folder.lstat(), stat.S_ISDIR, "folder")
    except OSError as error:
        raise SkillRuntimeError(f"{folder} can't be made ({error.strerror}): set XDG_RUNTIME_DIR to a folder of your own") from error
    return str(folder / f"{hashlib.sha256('|'.join(names).encode()).hexdigest()[:24]}.sock")


def pipe_key(address: str) -> bytes:
    """Return the key that the processes of this user have in common; the first that asks makes it, in the folder of the pipe.

    Raises:
        SkillRuntimeError: its file is not this user's alone.
    """
    file = Path(address).with_name("key")
    try:
        if not os.path.lexists(file):
            _make_key(file)
        _check_private(file, file.lstat(), stat.S_ISREG, "file")
        key = file.read_bytes()
    except OSError as error:
        raise SkillRuntimeError(f"{file} can't be read ({error.strerror}): remove it") from error
    if len(key) != KEY_BYTES:
        raise SkillRuntimeError(f"{file} has {len(key)} bytes, not {KEY_BYTES}: remove it")
    return key


def admit(pipe: Connection, key: bytes) -> None:
    """Check that the process which has connected has the key, and prove that we have it; nothing is unpickled before.

    Raises:
        EOFError, OSError: it has gone.
        AuthenticationError, AssertionError: it does not have the key.
    """
    deliver_challenge(pipe, key)
    answer_challenge(pipe, key)


def sealed(value: object) -> bytes:
    """Return what a robot's code has made as bytes of their own: an end that can't read them still knows which execution they are of.

    Raises what pickle raises, which may be anything.
    """
    return pickle.dumps(value)


def opened(content: bytes) -> Any:
    """Return what was sealed; raises what unpickling raises, which may be anything."""
    return pickle.loads(content)  # noqa: S301 - only from a process that has this user's key


def hang_up(pipe: Connection) -> None:
    """End a connection that another thread reads: reading it raises EOFError from now on, here and at its other end.

    To close it would not wake that thread, and the number of its file could be given to another file that is read then.
    """
    with contextlib.suppress(OSError), socket.socket(fileno=os.dup(pipe.fileno())) as end:
        end.shutdown(socket.SHUT_RDWR)


def _make_key(file: Path) -> None:
    """Make the key, whole and for this user alone from its first moment; one that another process has made meanwhile stands."""
    number, name = tempfile.mkstemp(dir=file.parent)
    try:
        os.write(number, secrets.token_bytes(KEY_BYTES))
        os.close(number)
        with contextlib.suppress(FileExistsError):
            os.link(name, file)
    finally:
        Path(name).unlink()


def _check_private(path: Path, seen: os.stat_result, is_kind: Callable[[int], bool], kind: str) -> None:
    """Raise SkillRuntimeError unless a path is of a kind, no link to one, and this user's alone."""
    if not is_kind(seen.st_mode):
        wrong = f"is no {kind} but a link or {'a file' if kind == 'folder' else 'a folder'}"
    elif seen.st_uid != os.getuid():
        wrong = f"belongs to user {seen.st_uid}, not to {os.getuid()}"
    elif seen.st_mode & 0o077:
        wrong = f"is open to others (mode {stat.S_IMODE(seen.st_mode):04o})"
    else:
        return
    raise SkillRuntimeError(f"{path} {wrong}: remove it")


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
