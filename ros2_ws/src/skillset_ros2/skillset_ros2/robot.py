"""A robot: the clients of its skillsets on one node. The generated ``<robot>_client`` derives its robot from ``RobotClient``."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import TracebackType
from typing import Self, TypeVar

from rclpy.node import Node

from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.views import SkillsetView
from skillset_ros2.client import SkillsetClient
from skillset_ros2.session import Session

CONNECT_S = 10.0
RobotT = TypeVar("RobotT", bound="RobotClient")


class NotThereError(SkillRuntimeError):
    """Skillsets that were asked for are not running; the message names them and says what to do."""


class RobotClient:
    """The skillsets of one robot; also a context manager, which ends what ``connect`` has started."""

    def __init__(self, node: Node, skillsets: Iterable[str], *, namespace: str = "") -> None:
        self.node = node
        self.clients: Mapping[str, SkillsetClient] = {name: SkillsetClient(node, name, namespace=namespace) for name in skillsets}
        self._session: Session | None = None

    @property
    def ready(self) -> bool:
        """Return whether all skillsets can be called."""
        return all(client.ready for client in self.clients.values())

    def wait_ready(self, timeout_s: float, skillsets: Sequence[str] = ()) -> bool:
        """Wait (wall clock) until the skillsets (with none named: all) can be called; return whether they can.

        Spins the node when no executor does. Raises CannotWaitError on the thread that spins it.
        """
        end = time.monotonic() + timeout_s
        names = skillsets or tuple(self.clients)
        return all(self.clients[name].wait_ready(max(0.0, end - time.monotonic())) for name in names)

    def close(self) -> None:
        """End every wait, and what ``connect`` has started; what runs goes on running. A second call does nothing."""
        for client in self.clients.values():
            client.close("this client was closed")
        if self._session is not None:
            session, self._session = self._session, None
            session.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


def connected(
    make: Callable[[Node], RobotT],
    name: str,
    *,
    namespace: str = "",
    domain: int | None,
    timeout_s: float,
    skillsets: Sequence[str] = (),
) -> RobotT:
    """Make a robot on a node that spins by itself, and wait until its skillsets can be called.

    Raises:
        NotThereError: they can't within the time.
    """
    session = Session(name, domain=domain, namespace=namespace)
    try:
        robot = make(session.node)
        robot._session = session  # noqa: SLF001 - what `close` ends
        _expect_ready(robot, skillsets, timeout_s)
    except BaseException:
        session.close()
        raise
    session.follow_clock()
    return robot


def _expect_ready(robot: RobotClient, skillsets: Sequence[str], timeout_s: float) -> None:
    if robot.wait_ready(timeout_s, skillsets):
        return
    missing = [name for name in skillsets or robot.clients if not robot.clients[name].ready]
    roots = ", ".join(f"/{robot.clients[name].root.lstrip('/')}" for name in missing)
    domain = robot.node.context.get_domain_id()
    raise NotThereError(
        f"no managers of {roots} in DDS domain {domain} within {timeout_s:g} s; are they running, and in this domain? "
        "`./alula panel --list` says what runs on this machine"
    )


class Robot(RobotClient):
    """A robot without generated client: ``robot["navigation"].takeoff(height=5.0, speed=1.0)``."""

    @classmethod
    def connect(cls, *skillsets: str, namespace: str = "", domain: int | None = None, timeout_s: float = CONNECT_S) -> Self:
        """Connect to skillsets by name, on a node that spins by itself; raise NotThereError."""
        make: Callable[[Node], Self] = lambda node: cls(node, skillsets, namespace=namespace)  # noqa: E731
        return connected(make, "robot_client", namespace=namespace, domain=domain, timeout_s=timeout_s)

    def __getitem__(self, skillset: str) -> SkillsetView:
        """Return a skillset; raise KeyError, and RuntimeError before ``wait_ready``."""
        if skillset not in self.clients:
            raise KeyError(f"this robot has no skillset {skillset!r}; it has {', '.join(self.clients)}")
        return self.clients[skillset].view

    def __iter__(self) -> Iterator[str]:
        return iter(self.clients)
