"""What can be wrong with the dead man's configuration."""

from __future__ import annotations


class ConfigError(ValueError):
    """A parameter is missing, unknown or wrong; the message names it, and says what it has to be."""
