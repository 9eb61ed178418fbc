"""The notation of the paper's Listings 1 to 3 (section 4.1), read by recursive descent."""

from skill_language.paper.skillset import parse

__all__ = ["parse"]
