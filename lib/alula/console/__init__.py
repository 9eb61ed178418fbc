"""The operator's page of a run that goes on: ``server`` serves the page of ``alula.report.page`` and what happens over a WebSocket.

``feed`` keeps the entries of a run for the pages that are open, ``commands`` and ``acts`` do what the operator asks for.
"""
