"""What can be wrong with a behaviour."""

from __future__ import annotations

from alula.runtime.core.errors import SkillRuntimeError


class BehaviourError(SkillRuntimeError):
    """A behaviour file is wrong; the message names the place, the error and the remedy."""
