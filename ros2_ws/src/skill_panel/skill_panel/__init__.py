"""A panel in the terminal to look at running skillsets and to drive them by hand: ``python -m skill_panel``.

``view``, ``form`` and ``memory`` are plain Python, ``watcher`` is the ROS side, ``app`` and ``widgets`` are the screen.
"""
