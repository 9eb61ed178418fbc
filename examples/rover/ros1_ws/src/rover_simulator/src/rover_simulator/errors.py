"""What can be wrong about what the simulator is given."""


class WorldError(Exception):
    """A world's file or a parameter is wrong; the message names the place and the remedy."""
