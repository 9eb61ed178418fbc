"""What can be wrong with a behaviour."""

from __future__ import annotations

from alula.runtime.core.errors import SkillRuntimeError


class BehaviourError(SkillRuntimeError):
    """A behaviour file is not as it should be; the message says where, what and what would be right."""
