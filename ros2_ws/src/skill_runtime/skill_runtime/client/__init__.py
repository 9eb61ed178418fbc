"""The skillset interface library (paper, section 4.2), over any middleware."""

from skill_runtime.client.client import Client

__all__ = ["Client"]
