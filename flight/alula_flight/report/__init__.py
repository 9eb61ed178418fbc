"""What a run was: `making.make_report` reads the run's folder and writes its summary, timeline and map picture there.

Imports nothing: a reader of events must not wait for matplotlib and Open3D.
"""
