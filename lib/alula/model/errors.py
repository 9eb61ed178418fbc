"""Errors of the model and of its semantics."""

from __future__ import annotations

from alula.common.errors import AlulaError


class SkillModelError(AlulaError):
    """Root of the errors of this package."""


class ModelFormatError(SkillModelError):
    """A JSON text is no model; the message names the place in it."""


class EffectError(SkillModelError):
    """An effect is no transition of a resource; the message names skill, effect, resource and states."""


class DataMissingError(SkillModelError):
    """A condition is over a data that has no fresh value."""


class UnsupportedModelError(SkillModelError):
    """The model has something that can't be executed."""
