"""What the skill layer costs beside bare rclpy: ``python -m skill_runtime.bench``, or ``./alula bench skills``."""
