"""The mission that `./alula bench console` commands: it starts at once, calls no skillset and never ends by itself."""
