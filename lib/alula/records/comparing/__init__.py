"""Runs side by side: what the mission decided, when, and the figures of each."""

from alula.records.comparing.sides import Compared, Side, compare, load_side

__all__ = ["Compared", "Side", "compare", "load_side"]
