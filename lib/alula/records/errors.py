"""Errors of this package."""

from __future__ import annotations


class AnalysisError(Exception):
    """Something can't be read or asked; the message names the place and what would be right."""
