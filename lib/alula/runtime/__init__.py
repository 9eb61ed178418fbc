"""Executes skillsets: managers and clients over the port to the middleware; ``live`` is what a live run is asked to be."""
