"""What a run was: ``making.make_report`` reads the run's folder, and writes its summary, timeline and page there.

What only one robot has (a map, a video) is its part ``report``, see ``part``. Imports nothing: a reader of events must not wait for
matplotlib.
"""
