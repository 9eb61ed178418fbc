"""A mock robot on the in-process middleware."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping, Sequence
from types import SimpleNamespace

from alula.common.public import public
from alula.mock.behaviour import Behaviour
from alula.mock.robot import MakeSkill, MockRobot
from alula.mock.skill import MockSkill
from alula.model.model import Skillset
from alula.runtime.core.events import EngineEvent, TransitionEvent
from alula.runtime.local import LocalWorld
from alula.runtime.timers import Job, Timer


class LocalMockHost:
    """A world as the host of a mock robot."""

    def __init__(self, world: LocalWorld) -> None:
        self._world = world
        self.notes: list[str] = []

    @property
    def now_s(self) -> float:
        """Mission clock, seconds."""
        return self._world.now_s

    def after(self, delay_s: float, job: Job) -> Timer:
        """Run a job after a delay."""
        return self._world.clock.after(delay_s, job)

    def transition(self, skillset: str, resource: str, to: str, reason: str) -> str:
        """Request an extern transition; return why it was refused, empty where it was taken."""
        managers = self._world.managers.get(skillset)
        if managers is None or not managers.alive:
            return f"the managers of {skillset} are not there"
        return managers.transition(resource, to, reason).reason

    def state(self, skillset: str, resource: str) -> str:
        """Return the state of a resource."""
        managers = self._world.managers.get(skillset)
        return "" if managers is None else managers.engine.resources[resource].state

    def publish(self, skillset: str, data: str, value: object) -> None:
        """Give a value of a data to the skillset's managers, if they are there."""
        managers = self._world.managers.get(skillset)
        if managers is not None and managers.alive:
            managers.publish(data, _namespaces(value))

    def note(self, error: str) -> None:
        """Add an error to ``notes``."""
        self.notes.append(error)


@public()
def mock_world(
    skillsets: Iterable[Skillset], behaviour: Behaviour | None = None, *, seed: int = 0, start_s: float = 0.0, latency_s: float = 0.0
) -> tuple[LocalWorld, MockRobot]:
    """Serve skillsets by mocks in one process; the robot's time begins with the first step of the world's."""
    world = LocalWorld(start_s=start_s, latency_s=latency_s)
    robot = MockRobot(behaviour or Behaviour(), LocalMockHost(world), seed=seed)
    serve_robot(world, robot, skillsets)
    return world, robot


def serve_robot(world: LocalWorld, robot: MockRobot, skillsets: Iterable[Skillset], make: MakeSkill = MockSkill) -> None:
    """Serve skillsets by the mocks of a robot whose host is the world, and have its timeline begin."""
    for skillset in skillsets:
        for resource in skillset.resources:
            robot.on_state(skillset.name, resource.name, resource.initial)
        # At once, whatever the world's latency: the functional layer is nearer than any client.
        world.serve(skillset, robot.hooks_of(skillset, make)).on_step(functools.partial(follow, robot, skillset.name))
    world.clock.soon(robot.begin)


def follow(robot: MockRobot, skillset: str, events: Sequence[EngineEvent]) -> None:
    """Report the states that resources enter to a mock robot; to be called at each step."""
    for event in events:
        if isinstance(event, TransitionEvent):
            robot.on_state(skillset, event.resource, event.to_state)


def _namespaces(value: object) -> object:
    if isinstance(value, Mapping):
        return SimpleNamespace(**{str(name): _namespaces(part) for name, part in value.items()})
    return [_namespaces(part) for part in value] if isinstance(value, list) else value
