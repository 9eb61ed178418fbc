"""The operator's page: one page for a run that goes on, over a WebSocket, and for one that is over, as ``report.html``.

``following`` reads what a run leaves in its folder, ``page`` makes the page, ``server`` serves it; what the page shows is a fold over
the run's entries, in ``page/fold.js``.
"""
