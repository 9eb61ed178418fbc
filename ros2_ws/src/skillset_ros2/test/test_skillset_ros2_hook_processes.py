"""The pipe to a skill's process carries pickle: only processes of the same user may use it, and each call is answered."""

from __future__ import annotations

import contextlib
import os
import re
import socket
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor, wait
from multiprocessing import AuthenticationError, Pipe
from multiprocessing.connection import Client, Connection, Listener
from pathlib import Path

import pytest

from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.core.execution import Execution
from alula.runtime.core.hook_calls import HookOutcome
from alula.runtime.hook_processes import HookServer, RemoteHooks, pipe_address
from alula.runtime.hook_processes.pipe import hang_up, pipe_key
from alula.runtime.hooks import SkillHooks
from alula_testing.runtime_models import flying_skill, flying_skillset
from alula_testing.waits import until

SOON_S = 10.0
QUIET_S = 0.3
SKILLSET = flying_skillset(flying_skill("film"))


@pytest.fixture
def place(monkeypatch, tmp_path):
    """Return the folder of this user's pipes, which is not there yet."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path / f"alula-{os.getuid()}"


@pytest.fixture
def told():
    return []


@pytest.fixture
def remote(place, told):
    remote = RemoteHooks(SKILLSET, pipe_address("test"), told.append)
    yield remote
    remote.close()


class Bomb:
    """Makes a folder where it is unpickled."""

    def __init__(self, marker: Path) -> None:
        self.marker = marker

    def __reduce__(self):
        return os.mkdir, (str(self.marker),)


def read_to_the_end(pipe: Connection) -> None:
    """Read what the other end sends, raw, until it has gone."""
    with contextlib.suppress(EOFError, ConnectionResetError):
        while pipe.poll(SOON_S):
            pipe.recv_bytes()
        pytest.fail("the other end is still there")


def test_the_folder_is_the_users_own_and_closed_to_others(place):
    address = Path(pipe_address("test"))
    assert address.parent == place
    assert place.stat().st_mode & 0o777 == 0o700
    assert pipe_address("test") == str(address)
    assert pipe_address("other") != str(address)


def test_a_folder_that_is_a_link_is_refused_wherever_it_leads(place, tmp_path):
    (tmp_path / "mine").mkdir(mode=0o700)
    for target in (tmp_path / "mine", tmp_path / "nowhere"):
        place.symlink_to(target)
        with pytest.raises(SkillRuntimeError, match=re.escape(f"{place} is no folder but a link or a file: remove it")):
            pipe_address("test")
        place.unlink()
    place.write_text("")
    with pytest.raises(SkillRuntimeError, match="is no folder"):
        pipe_address("test")


@pytest.mark.parametrize("mode", [0o755, 0o710, 0o701, 0o770])
def test_a_folder_that_others_may_enter_is_refused(place, mode):
    place.mkdir()
    place.chmod(mode)
    with pytest.raises(SkillRuntimeError, match=re.escape(f"{place} is open to others (mode {mode:04o}): remove it")):
        pipe_address("test")


def test_a_folder_of_another_user_is_refused(place, monkeypatch):
    owner, other = os.getuid(), os.getuid() + 1
    monkeypatch.setattr(os, "getuid", lambda: other)
    with pytest.raises(SkillRuntimeError, match=f"alula-{other} belongs to user {owner}, not to {other}: remove it"):
        pipe_address("test")


def test_a_folder_that_can_not_be_made_is_told(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "nowhere"))
    with pytest.raises(SkillRuntimeError, match=r"nowhere/alula-.* can't be made .*: set XDG_RUNTIME_DIR"):
        pipe_address("test")


def test_managers_say_in_one_line_what_is_wrong_with_the_folder(place, tmp_path):
    pytest.importorskip("rclpy")
    place.symlink_to(tmp_path)
    script = str(Path(__file__).with_name("skillset_ros2_process.py"))
    done = subprocess.run([sys.executable, script, "--part", "resources"], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 2
    assert [line for line in done.stderr.splitlines() if str(place) in line] == done.stderr.splitlines()[-1:]


def test_whoever_reads_a_pipe_that_is_hung_up_is_told_at_both_ends():
    ends = Pipe()
    with ThreadPoolExecutor(2) as threads:
        reading = [threads.submit(end.recv) for end in ends]
        assert not wait(reading, QUIET_S).done
        hang_up(ends[0])
        errors = [one.exception(SOON_S) for one in reading]
    assert [type(error) for error in errors] == [EOFError] * 2
    hang_up(ends[0])
    ends[0].close()
    hang_up(ends[0])


def test_all_processes_of_the_user_have_one_key_that_other_users_can_not_read(place):
    address = pipe_address("test")
    with ThreadPoolExecutor(8) as threads:
        keys = set(threads.map(pipe_key, [address] * 8))
    assert {len(key) for key in keys} == {32}
    assert len(keys) == 1
    assert [(path.name, path.stat().st_mode & 0o777) for path in place.iterdir()] == [("key", 0o600)]


def test_a_key_that_others_may_know_is_refused(place, tmp_path):
    address = pipe_address("test")
    key = place / "key"
    (tmp_path / "theirs").write_bytes(bytes(32))
    (tmp_path / "theirs").chmod(0o600)
    key.symlink_to(tmp_path / "theirs")
    with pytest.raises(SkillRuntimeError, match=re.escape(f"{key} is no file but a link or a folder: remove it")):
        pipe_key(address)
    key.unlink()
    pipe_key(address)
    key.chmod(0o640)
    with pytest.raises(SkillRuntimeError, match=re.escape(f"{key} is open to others (mode 0640): remove it")):
        pipe_key(address)
    key.chmod(0o600)
    key.write_bytes(b"short")
    with pytest.raises(SkillRuntimeError, match=f"{key} has 5 bytes, not 32: remove it"):
        pipe_key(address)


def test_a_process_with_the_key_is_served(remote, told):
    server = HookServer(SKILLSET.name, "film", SkillHooks(), pipe_address("test"), told.append)
    assert remote.wait(SOON_S) == []
    server.close("over", SOON_S)
    assert told == []


@pytest.mark.parametrize("what", ["plain", "wrong key"])
def test_of_a_process_without_the_key_nothing_is_unpickled(remote, told, tmp_path, what):
    address, marker = pipe_address("test"), tmp_path / "marker"
    if what == "plain":
        with Client(address) as pipe:
            pipe.send(("hello", "film", [Bomb(marker)]))
            read_to_the_end(pipe)
    else:
        with pytest.raises(AuthenticationError):
            Client(address, authkey=b"guessed")
    until(lambda: told, "it is told", SOON_S)
    assert told == ["a process without this user's key was refused at the pipe of the hooks"]
    assert remote.wait(QUIET_S) == ["film"]
    assert not marker.exists()


def test_of_managers_without_the_key_nothing_is_unpickled(place, told, tmp_path):
    address, marker = pipe_address("test"), tmp_path / "marker"
    with Listener(address) as listener:
        server = HookServer(SKILLSET.name, "film", SkillHooks(), address, told.append)
        for _ in range(2):
            with listener.accept() as pipe:
                pipe.send(("event", Bomb(marker)))
                read_to_the_end(pipe)
        server.close("over", SOON_S)
    assert not marker.exists()
    assert told == [f"the process that listens at {address} does not have this user's key; end it"]


def test_a_silent_connection_does_not_keep_others_out(remote, told):
    address = pipe_address("test")
    with socket.socket(socket.AF_UNIX) as silent:
        silent.connect(address)
        server = HookServer(SKILLSET.name, "film", SkillHooks(), address, told.append)
        assert remote.wait(SOON_S) == []
        server.close("over", SOON_S)
    assert told == []


def test_a_call_that_meets_the_end_of_its_process_is_answered_once(remote):
    address = pipe_address("test")
    others = set(threading.enumerate())
    with Client(address, authkey=pipe_key(address)) as pipe:
        pipe.send(("hello", "film", ["on_dispatch"]))
        assert remote.wait(SOON_S) == []
        process = remote._processes["film"]
    until(lambda: not remote._processes, "the end is noticed", SOON_S)
    until(lambda: set(threading.enumerate()) <= others, "the end was dealt with", SOON_S)
    remote._processes["film"] = process  # the engine asked for it just before
    answers: list[HookOutcome] = []
    remote.call(Execution(remote, "1", "film", {}), "on_dispatch", answers.append)
    assert ["its process has ended" in answer.error for answer in answers] == [True]
