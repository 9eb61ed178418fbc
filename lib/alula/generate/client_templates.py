"""Templates of the typed clients: one module a skillset, one package a robot."""

CLIENT = '''\
"""The skillset ``$skillset`` as its users call it, with types: a thin layer over the generic client.

$header.
"""

from __future__ import annotations

$typing
from alula.runtime.handle import Handle
from alula.runtime.views import Access, DataView, ResourceView, Skill, TypedSkillset
$imports
$states
$skills


class ${camel}Data:
    """The data of ``$skillset``; a value is followed from the first time that it is asked for."""

    def __init__(self, client: Access) -> None:
$data


class ${camel}Client(TypedSkillset):
    """The skillset ``$skillset``: its skills to call, its resources and ``data`` to look at."""

    def __init__(self, client: Access) -> None:
        super().__init__(client)
        self.data = ${camel}Data(client)
$members
'''

SKILL = '''

$result_type


class ${camel}Outputs(TypedDict, total=False):
    """Outputs of ``$skill``; empty before it has reported any."""
$outputs

class ${camel}Skill(Skill[${camel}Outputs, ${camel}Result]):
    """The skill ``$skill``; call it to start it."""

$definition
        """Start ``$skill``; never waits. Wait for the handle, await it, or iterate over its reports.
$arguments$results
        """
$start
'''

ROBOT = '''\
"""The robot ``$robot``: its skillsets with types.

$header.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

$imports

from skillset_ros2.robot import CONNECT_S, RobotClient, connected

if TYPE_CHECKING:
    from typing import Self  # of Python 3.11

    from rclpy.node import Node

SKILLSETS = ($names)


class $camel(RobotClient):
    """The robot ``$robot``; its skillsets are attributes.

    Args:
        node: serves it; the caller spins it.
        namespace: of the robot, as ``/robot1``; by default the node's.
    """

    def __init__(self, node: Node, *, namespace: str = "") -> None:
        super().__init__(node, SKILLSETS, namespace=namespace)
$members

    @classmethod
    def connect(
        cls, *, namespace: str = "", domain: int | None = None, timeout_s: float = CONNECT_S, skillsets: Sequence[str] = SKILLSETS
    ) -> Self:
        """Connect on a node that spins by itself, and wait until the skillsets can be called; use it in a ``with``.

        Args:
            namespace: of the robot, as ``/robot1``.
            domain: the DDS domain; by default the environment's ROS_DOMAIN_ID.
            timeout_s: how long to wait, wall clock.
            skillsets: those that have to be there.

        Raises:
            NotThereError: they are not there within the time.
        """
        make = partial(cls, namespace=namespace)
        return connected(make, "$package", namespace=namespace, domain=domain, timeout_s=timeout_s, skillsets=skillsets)
'''

INIT = '''\
"""The robot ``$robot`` for its users: ``from $package import $camel``.

$header.
"""

from $package.robot import $camel

__all__ = ["$camel"]
'''
