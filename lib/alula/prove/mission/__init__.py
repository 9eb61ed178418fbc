"""A mission looked at together with the skillsets that it uses: all runs of its tree, of their managers, and of what happens to them.

``System`` (in ``system``) is the transition system: all that follows is proved, counted or played on it.
"""
