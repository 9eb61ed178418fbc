"""The hexacopter: rigid body, rotors, wind and the cascaded controller that flies it."""
