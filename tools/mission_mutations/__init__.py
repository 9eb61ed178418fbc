"""How surely `check` finds what is wrong with a mission: alters a robot's missions and models, and looks what the search makes of them."""
