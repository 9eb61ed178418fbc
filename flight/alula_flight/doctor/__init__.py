"""Find what is wrong with a deployment: names, the ROS 1 master and its nodes, the bindings, ROS 2, clocks, the disk."""
