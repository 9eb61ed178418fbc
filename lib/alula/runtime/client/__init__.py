"""The skillset interface library (paper, section 4.2), over any middleware."""

from alula.runtime.client.client import Client

__all__ = ["Client"]
