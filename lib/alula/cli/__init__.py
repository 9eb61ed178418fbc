"""The command line ``alula``: the table of its commands, what hands over to them, and those that need no ROS.

``table`` declares every command, ``options`` holds what each of them takes; both import nothing that a command needs, so that help, a
wrong word and completion come at once. ``__main__`` is the front: it finds the robot, and hands over. Each module of a command has a
``main(words) -> exit code``. ``checkout`` is what a checkout has besides: a set-up, and commands that need ROS.
"""
