"""The notation of the paper's Listings 1 to 3 (section 4.1), read by recursive descent."""

from alula.language.paper.notation import PAPER, parse

__all__ = ["PAPER", "parse"]
