"""A panel in the terminal that shows running skillsets and controls them manually: ``python -m skill_panel``.

``view``, ``form`` and ``memory`` are plain Python, ``watcher`` is the ROS side, ``app`` and ``widgets`` are the screen.
"""
