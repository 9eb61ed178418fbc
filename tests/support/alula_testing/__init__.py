"""Live ROS graphs for tests: each pytest process has a ROS 1 master and a DDS domain of its own."""
