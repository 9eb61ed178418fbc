"""Attacks on managers and clients of a skillset through their public interface, the same ones in every world.

``python -m alula_testing.attacks ros1|ros2`` reads names of attacks line by line and answers each with a line of JSON.
"""

from alula_testing.attacks.attacks import ATTACKS
from alula_testing.attacks.local import LocalGraph

__all__ = ["ATTACKS", "LocalGraph"]
