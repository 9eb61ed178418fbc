"""The telepilot's end of the radio: video received, shown, measured and reported; the control link. The core needs no ROS."""
