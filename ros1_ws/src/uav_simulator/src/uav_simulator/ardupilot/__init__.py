"""ArduPilot's own program flies the simulator's body, over the JSON interface of its simulator."""
