"""Sets planners beside `alula plan`: one case from a robot's models, as PDDL as far as PDDL can say it."""
