"""All managers of one skillset in one rospy node (paper, section 4.2 and Figure 2)."""

from __future__ import annotations

import socket
from collections.abc import Callable, Mapping
from types import ModuleType

import rosgraph
import rospy

from alula.model.model import Skillset
from alula.runtime.core.engine import DEFAULT_TIMEOUT_S, HOOK_TIMEOUT_S, SkillsetEngine
from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.hooks import SkillHooks
from alula.runtime.managers import DataBindings, Managers, generated_bindings
from alula.runtime.staleness import with_silences
from skillset_ros1.middleware import RospyMiddleware
from skillset_ros1.names import place

CONNECT_S = 1.0


class SkillsetManagers:
    """The data manager, the resource manager and the skill managers of a skillset, in this process's rospy node.

    Hooks are called on threads of their own; nothing of the node waits for one.
    Parameters of the node: ``~interrupt_timeout_s``, ``~hook_timeout_s``, and ``~silence/RESOURCE`` in seconds.

    Args:
        skillset: the model.
        interfaces: the generated package ``<skillset>_interfaces``, or its module ``msg``.
        hooks_factory: makes the hooks, one a skill, with these managers at hand.
        data_bindings: where each data of the model comes from; by default the generated ``<skillset>_managers.model.DATA_TOPICS``.
        namespace: before the skillset's name; by default the node's.

    Raises:
        SkillRuntimeError: managers of this skillset are there already, a skill has no hooks, a data no binding, or the parameter is
            no time.
        AttributeError: the interfaces have no action for a skill.
    """

    def __init__(
        self,
        skillset: Skillset,
        interfaces: ModuleType,
        hooks_factory: HooksFactory,
        *,
        data_bindings: DataBindings | None = None,
        namespace: str = "",
    ) -> None:
        self.skillset = skillset = with_silences(skillset, lambda name, model_s: float(rospy.get_param(f"~silence/{name}", model_s)))
        self.place = place(namespace, skillset.name)
        check_alone(self.place)
        self._middleware = RospyMiddleware(skillset.name, self.place, interfaces)
        self._managers = Managers(
            self._middleware,
            skillset,
            hooks_factory(self),
            bindings=generated_bindings(skillset) if data_bindings is None else data_bindings,
            interrupt_timeout_s=float(rospy.get_param("~interrupt_timeout_s", DEFAULT_TIMEOUT_S)),
            hook_timeout_s=float(rospy.get_param("~hook_timeout_s", HOOK_TIMEOUT_S)),
        )
        self.skills = self._managers.skills

    @property
    def engine(self) -> SkillsetEngine:
        """The engine of the managers."""
        return self._managers.engine

    def close(self, reason: str) -> None:
        """Fail whatever runs for this reason, so that functions are stopped, and take no more requests."""
        self._managers.close(reason)

    def destroy(self) -> None:
        """Unregister all topics and services; to be called after ``close``, by a process that lives on."""
        self._middleware.close()


HooksFactory = Callable[[SkillsetManagers], Mapping[str, SkillHooks]]


def check_alone(root: str) -> None:
    """Raise SkillRuntimeError when live managers of this name are registered at the master; needs no node."""
    try:
        uri = rosgraph.Master("/skillset_ros1").lookupService(f"{root}/describe")
    except rosgraph.MasterException:
        return
    host, port = rospy.core.parse_rosrpc_uri(uri)
    try:
        socket.create_connection((host, port), CONNECT_S).close()
    except OSError:
        return
    raise SkillRuntimeError(f"managers of {root} are there already ({uri}); end them first")
