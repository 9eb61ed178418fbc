"""Sensors for a vehicle that flies elsewhere: pose and clock are taken from its autopilot's MAVLink."""
