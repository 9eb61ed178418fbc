"""The autopilot: behaves as ArduCopter 4.6 as seen by a MAVLink client."""
