"""What the public API adds where no single room has the entry: each class and function here is offered by `alula`."""
