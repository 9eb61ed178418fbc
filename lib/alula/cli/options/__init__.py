"""What each command takes, a function each, which adds it to a parser. Nothing here imports what a command needs."""
