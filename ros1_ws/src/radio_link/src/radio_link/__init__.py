"""The radio between drone and ground, emulated packet by packet on the mission clock. The core needs no ROS."""
