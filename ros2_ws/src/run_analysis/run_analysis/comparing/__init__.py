"""Runs side by side: what the mission decided, when, and the figures of each."""

from run_analysis.comparing.sides import Compared, Side, compare, load_side

__all__ = ["Compared", "Side", "compare", "load_side"]
