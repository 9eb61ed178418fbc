"""The error of a wrong configuration."""

from __future__ import annotations


class ConfigError(ValueError):
    """A parameter is missing, unknown or wrong; the message has its name and the allowed values."""
