"""What comes through the pipe to a skill's process and can't be read ends its execution, and nothing after it."""

from __future__ import annotations

import threading
from multiprocessing.connection import Client

import pytest

from alula.model.execution_state import ExecutionState as S
from alula.runtime.core import SkillsetEngine
from alula.runtime.hook_processes import HookServer, RemoteHooks, pipe_address
from alula.runtime.hook_processes.pipe import pipe_key
from alula.runtime.hooks import SkillHooks
from alula_testing.runtime_models import flying_skill, flying_skillset
from alula_testing.waits import until

SKILLSET = flying_skillset(flying_skill("film"))


def explode() -> None:
    raise ZeroDivisionError("nobody can read this")


class Trap:
    """Can be pickled, and not be unpickled."""

    def __reduce__(self) -> tuple:
        return explode, ()


class Film(SkillHooks):
    """Hands over what the test has told."""

    def __init__(self) -> None:
        self.hands = ""

    def on_dispatch(self, execution) -> None:
        if self.hands == "terminate":
            execution.terminate("DONE", "there", {"reached": Trap()})
        elif self.hands == "set_outputs":
            execution.set_outputs(reached=Trap())
        elif self.hands == "unsendable":
            execution.terminate("DONE", "there", {"reached": lambda: 0})
        else:
            execution.terminate("DONE", "there", {"reached": 1.0})


class Rig:
    """An engine, the pipe, and a skill's process at its other end, which is a thread here."""

    def __init__(self) -> None:
        self.errors: list[str] = []
        self.address = pipe_address("test")
        self.remote = RemoteHooks(SKILLSET, self.address, self.errors.append)
        self.engine = SkillsetEngine(SKILLSET, lambda: 0, self.remote, lambda _: None, on_error=self.errors.append, hook_timeout_s=None)
        self.remote.attach(self.engine)
        assert self.engine.transition("sdk", "AVAILABLE").accepted
        self.film = Film()
        self.server: HookServer | None = None

    def serve(self) -> None:
        self.server = HookServer("flying", "film", self.film, self.address, self.errors.append)
        assert self.remote.wait(60.0) == []

    def ended(self, inputs: dict | None = None):
        execution = self.engine.request("film", inputs or {"height": 1.0})
        until(lambda: execution.done, "the execution has ended")
        return execution

    def close(self) -> None:
        if self.server is not None:
            self.server.close("over", 10.0)
        self.remote.close()


@pytest.fixture
def rig(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    rig = Rig()
    yield rig
    rig.close()


@pytest.mark.parametrize(
    ("hands", "told"),
    [
        ("terminate", "what its hook handed over can't be read: ZeroDivisionError: nobody can read this"),
        ("set_outputs", "what its hook handed over can't be read: ZeroDivisionError: nobody can read this"),
        ("unsendable", "the outcome of film's hook can't be sent"),
    ],
)
def test_outputs_that_can_not_be_read_end_their_execution_and_the_next_one_runs(rig, hands, told):
    rig.serve()
    rig.film.hands = hands
    execution = rig.ended()
    assert execution.state is S.FAILED
    assert told in execution.message
    rig.film.hands = ""
    assert rig.ended().state is S.TERMINATED


@pytest.mark.parametrize("value", [Trap(), lambda: 0])
def test_inputs_that_can_not_be_read_end_their_execution_and_the_next_one_runs(rig, value):
    rig.serve()
    execution = rig.ended({"height": value})
    assert execution.state is S.FAILED
    assert "its inputs can't be" in execution.message
    assert rig.ended().state is S.TERMINATED


@pytest.mark.parametrize("junk", ["bytes", "trap", "nothing", "answer", "hello"])
def test_a_process_that_sends_what_is_no_message_is_given_up_and_another_one_serves(rig, junk):
    pipe = Client(rig.address, authkey=pipe_key(rig.address))
    try:
        if junk == "hello":
            pipe.send(Trap())
            with pytest.raises(EOFError):
                pipe.recv()
            assert "can't be read: ZeroDivisionError" in rig.errors[0]
        else:
            pipe.send(("hello", "film", ["on_dispatch"]))
            assert rig.remote.wait(60.0) == []
            execution = rig.engine.register("film", {"height": 1.0})
            rig.engine.run(execution.id)
            _, number, hook, _ = pipe.recv()
            assert hook == "on_dispatch"
            if junk == "bytes":
                pipe.send_bytes(b"\x80junk")
            else:
                pipe.send({"trap": ("answer", number, Trap()), "nothing": None, "answer": ("answer", number, b"no pickle", 1)}[junk])
            until(lambda: execution.done, "the execution has ended")
            assert execution.state is S.FAILED
            assert "the manager of film has gone: what it sent can't be read" in execution.message
    finally:
        pipe.close()
    rig.serve()
    assert rig.ended().state is S.TERMINATED


class Stopping(Film):
    """Is held in ``on_start`` until the test lets go."""

    def __init__(self) -> None:
        super().__init__()
        self.started, self.go = threading.Event(), threading.Event()

    def on_start(self) -> None:
        self.started.set()
        self.go.wait()


def test_a_process_that_was_started_again_stops_what_ran_before_it_takes_requests(rig):
    rig.serve()
    assert rig.ended().state is S.TERMINATED
    rig.server.close("its process ends", 10.0)
    until(lambda: rig.remote.wait(0.0) == ["film"], "it is gone")
    rig.film = Stopping()
    rig.serve()
    assert rig.film.started.wait(60.0)
    refused = rig.ended()
    assert (refused.state, refused.message) == (S.NOT_VALIDATED, "what ran before has yet to be stopped: film")
    rig.film.go.set()
    until(lambda: rig.engine.why("film").ready, "it is ready")
    assert rig.ended().state is S.TERMINATED


def test_a_skill_whose_process_was_gone_when_the_managers_started_is_ready_when_it_comes(rig):
    begun = []
    rig.engine.start(rig.engine.skills_to_start, lambda job: job(), lambda: begun.append(True))
    assert begun == [True]
    assert "its process has ended" in rig.engine.why("film").reason
    rig.serve()
    until(lambda: rig.engine.why("film").ready, "it is ready")
    assert rig.ended().state is S.TERMINATED
