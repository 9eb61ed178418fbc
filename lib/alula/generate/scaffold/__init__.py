"""Working skeletons to begin with: ``alula new robot DIR``."""
