"""What editors ask about skill models: a language server over the standard streams, and what answers it."""
