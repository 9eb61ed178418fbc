"""Executes skillsets: ``core`` without ROS, ``ros2`` managers and client over rclpy, ``hooks`` what a developer of skills writes."""
