"""A hexacopter with its autopilot, its sensors and the yard it flies in: what stands where vehicle and drivers stand on the real drone."""
