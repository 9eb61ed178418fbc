"""How surely the conformance check tells altered logs from good ones: alters logs of mock flights and counts what is caught."""
