"""The page of a run: one HTML file, shown live by the console and kept as the run's ``report.html``.

``following`` reads what a run leaves in its folder, as entries (``entries``); ``causes`` adds why skills failed; ``writing`` puts entries
and ``program/`` together. What the page shows is a fold over its entries, in ``program/fold.js``.
"""
