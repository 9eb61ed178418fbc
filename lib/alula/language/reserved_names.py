"""Names that generated code has for itself. The checker refuses some of them in a model; for others, generated code adds ``_``."""

from __future__ import annotations

import keyword

from alula.model.ros_types import FEEDBACK_FIELDS, RESULT_FIELDS

INPUTS = frozenset({"self", "skill"})
"""Refused as inputs: parameters of the client's methods, which take the inputs by name."""
OUTPUTS = frozenset({"self", "execution", *RESULT_FIELDS, *FEEDBACK_FIELDS})
"""Refused as outputs: parameters of ``terminated_...``, which takes the outputs by name, and fields of every skill's action."""
CLIENT = frozenset({"client", "data"})
"""Attributes of every skillset's client (``alula.runtime.views.TypedSkillset``), beside its skills and resources."""
ROBOT = frozenset({"node", "clients", "ready", "wait_ready", "close", "connect"})
"""Attributes of every robot's client (``skillset_ros2.robot.RobotClient``), beside its skillsets."""


class Attributes:
    """The attributes of one generated class: each name as it is, or with ``_`` behind it where that is taken or a keyword of Python."""

    def __init__(self, reserved: frozenset[str]) -> None:
        self._taken = {*reserved, *keyword.kwlist}

    def add(self, name: str) -> str:
        """Return the attribute for a name."""
        while name in self._taken:
            name += "_"
        self._taken.add(name)
        return name
