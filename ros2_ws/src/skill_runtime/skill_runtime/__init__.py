"""Executes skillsets: ``core`` without ROS, ``ros2`` the managers and the client over rclpy, ``hooks`` what a developer of skills writes."""
