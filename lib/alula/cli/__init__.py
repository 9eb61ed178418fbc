"""Commands of ``alula``: each module has a ``main(words) -> exit code``."""
