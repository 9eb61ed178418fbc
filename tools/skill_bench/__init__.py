"""What the skill layer costs beside bare rclpy: ``python -m skill_bench``, or ``./alula bench skills``."""
