"""What this room complains of."""


class OddsError(Exception):
    """The odds can't be had; the message says why, where, and what would be right."""
