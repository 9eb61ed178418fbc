"""What a client makes of managers that it can't call."""

from __future__ import annotations

import pytest
from runtime_local_rig import make

from alula.model.json_form import to_json
from alula.runtime.client.connection import Connection
from alula_testing.runtime_models import flying_skillset

MODEL = to_json(flying_skillset())


class Managers:
    """A middleware with managers at its other end that describe themselves as ``model``."""

    def __init__(self, model: str) -> None:
        self.model = model
        self.types = True
        self.asked = 0
        self.logged: list[str] = []
        self.log = self.logged.append

    def call(self, _service, _request, on_reply, _on_error, *, timeout_s) -> None:
        self.asked += 1
        on_reply(self.model, 1)

    def action(self, skill, _listener):
        if not self.types:
            raise ModuleNotFoundError(f"there is no type of {skill}")
        return type("Link", (), {"connected": True})()

    def when(self, condition, job) -> None:
        if condition():
            job()

    def now_ns(self) -> int:
        return 0


def connection(managers: Managers) -> Connection:
    nothing = lambda: None  # noqa: E731
    return Connection(managers, "flying", None, on_restart=nothing, on_alive=nothing, on_gone=nothing)


@pytest.mark.parametrize(("model", "types"), [("{}", True), ("no JSON", True), ("null", True), (MODEL, False)])
def test_managers_that_can_not_be_called_are_told_of_once_and_their_next_ones_are_called(model, types):
    managers = Managers(model)
    managers.types = types
    known = connection(managers)
    for _ in range(3):
        known.on_heartbeat("old")
    assert managers.asked == 1
    (told,) = managers.logged
    assert told.startswith("the managers of flying can't be called: ")
    assert known.missing == "a description that can be used here"
    managers.model, managers.types = MODEL, True
    known.on_heartbeat("new")
    known.heard_states()
    assert known.ready.is_set()
    assert known.missing == ""


def test_goals_that_have_ended_are_not_interrupted():
    world, client = make()
    for _ in range(3):
        handle = client.start("takeoff", height=1.0)
        assert world.run_until(lambda handle=handle: handle.done, timeout_s=10.0)
    assert client.interrupt_all("takeoff").get(1.0) == 0
    client.start("takeoff", height=1.0)
    world.run_for(0.5)
    assert client.interrupt_all("takeoff").get(1.0) == 1
    (managers,) = world.bus.served.values()
    world.run_for(5.0)
    assert [server.goals for server in managers.actions.values()] == [set()]
