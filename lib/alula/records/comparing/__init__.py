"""Runs side by side: what the mission decided, when, and the figures of each."""

from alula.records.comparing.sides import Compared, ComparedDecision, Difference, Side, compare, load_side

__all__ = ["Compared", "ComparedDecision", "Difference", "Side", "compare", "load_side"]
