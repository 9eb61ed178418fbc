"""The telepilot's video: encode, send as RTP, adapt to what the ground station reports. The core needs no ROS."""
