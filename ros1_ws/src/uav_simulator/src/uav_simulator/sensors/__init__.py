"""The sensors, by ray casting: a stereo pair, a LiDAR that scans across the direction of flight, an IMU."""
