"""The rclpy nodes of a skillset (paper, section 4.2 and Figure 2): all its managers, or the hooks of one skill."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any

from rclpy.node import Node

from alula.model.model import Skillset
from alula.runtime.core.engine import DEFAULT_TIMEOUT_S, HOOK_TIMEOUT_S, SkillsetEngine
from alula.runtime.core.hook_calls import HookCaller
from alula.runtime.hook_processes import HookServer, RemoteHooks
from alula.runtime.hooks import SkillHooks
from alula.runtime.managers import HOOKS_RETURN_S, DataBindings, Managers, generated_bindings
from alula.runtime.staleness import with_silences
from skillset_ros2.middleware import RclpyMiddleware
from skillset_ros2.names import action_type
from skillset_ros2.simulated_time import SimulatedTime

HooksFactory = Callable[[Node], Mapping[str, SkillHooks]]
WITHOUT_PARAMETER_SERVICES = {"start_parameter_services": False}
"""The parameters are what a node was started with; their six services are entities that each turn of the executor gathers."""


class SkillsetNode(Node):  # type: ignore[misc]  # rclpy has no types
    """The data manager, the resource manager and the skill managers of a skillset; the node has the skillset's name.

    Parameters: ``interrupt_timeout_s``, ``hook_timeout_s``, and ``silence.SKILLSET.RESOURCE`` in seconds for each that has one.
    Hooks are called on threads of their own; the executor never waits for one.

    Args:
        skillset: the model.
        interfaces: the generated package ``<skillset>_interfaces``, or its module ``action``.
        hooks: makes the hooks, one a skill, with this node at hand; or what calls them in other processes.
        data_bindings: where each data of the model comes from; by default the generated ``<skillset>_managers.model.DATA_TOPICS``.
        on_rival: called with the reason when managers of this skillset are there already; by default these close.
        node_options: passed on to ``rclpy.node.Node`` (``namespace``, ``parameter_overrides``, ``context``).

    Raises:
        SkillRuntimeError: a skill has no hooks, or a data no binding.
        AttributeError: the interfaces have no action for a skill.
    """

    def __init__(
        self,
        skillset: Skillset,
        interfaces: ModuleType,
        hooks: HooksFactory | HookCaller,
        *,
        data_bindings: DataBindings | None = None,
        on_rival: Callable[[str], None] | None = None,
        **node_options: Any,
    ) -> None:
        super().__init__(skillset.name, **WITHOUT_PARAMETER_SERVICES | node_options)
        self._simulated_time = SimulatedTime(self)
        given_s = lambda name, model_s: float(self.declare_parameter(f"silence.{skillset.name}.{name}", model_s).value)  # noqa: E731
        self.skillset = skillset = with_silences(skillset, given_s)
        self.served_skills = tuple(skill.name for skill in skillset.skills)
        for name in self.served_skills:
            action_type(interfaces, name)
        timeout_s = float(self.declare_parameter("interrupt_timeout_s", DEFAULT_TIMEOUT_S).value)
        hook_timeout_s = float(self.declare_parameter("hook_timeout_s", HOOK_TIMEOUT_S).value)
        made = hooks(self) if callable(hooks) else hooks
        self.managers = Managers(
            RclpyMiddleware(self, skillset.name, interfaces=interfaces),
            skillset,
            made,
            bindings=generated_bindings(skillset) if data_bindings is None else data_bindings,
            interrupt_timeout_s=timeout_s,
            hook_timeout_s=hook_timeout_s,
            on_rival=on_rival,
        )
        if isinstance(made, RemoteHooks):
            made.attach(self.engine)
            self.managers.on_step.append(made.on_step)

    @property
    def engine(self) -> SkillsetEngine:
        """The engine of the managers."""
        return self.managers.engine

    def fail_all(self, reason: str) -> None:
        """Fail whatever runs for this reason."""
        self.engine.fail_all(reason)

    def close(self, reason: str) -> None:
        """Fail whatever runs for this reason, so that functions are stopped, and take no more requests."""
        self.managers.close(reason)

    def destroy_node(self) -> None:
        """Take no more ticks of a simulated clock, and destroy the node."""
        self._simulated_time.close()
        super().destroy_node()


class HooksNode(Node):  # type: ignore[misc]
    """The hooks of one skill in a process of their own, node ``<skillset>_<skill>``; the engine is at ``address``."""

    def __init__(self, skillset: Skillset, skill: str, hooks: HooksFactory, address: str, **node_options: Any) -> None:
        super().__init__(f"{skillset.name}_{skill}", **WITHOUT_PARAMETER_SERVICES | node_options)
        self._simulated_time = SimulatedTime(self)
        self.served_skills = (skill,)
        self._server = HookServer(skillset.name, skill, hooks(self)[skill], address, self.get_logger().error)

    def fail_all(self, reason: str) -> None:
        """Fail whatever runs for this reason."""
        self._server.fail_all(reason)

    def close(self, reason: str) -> None:
        """Fail whatever runs here for this reason, so that functions are stopped."""
        if not self._server.close(reason, HOOKS_RETURN_S):
            self.get_logger().error(f"a hook has not returned within {HOOKS_RETURN_S:g} s; it is left behind")

    def destroy_node(self) -> None:
        """Take no more ticks of a simulated clock, and destroy the node."""
        self._simulated_time.close()
        super().destroy_node()
