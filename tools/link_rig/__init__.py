"""The rover on two computers that lose each other, or a process: what it then does, judged by the simulator's truth."""
