"""Live runs: what one is asked to be, and what a robot adds to it. No ROS."""
