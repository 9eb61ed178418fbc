"""Plain Python below everything else: files, processes, signals, ports and domains. Imports no ROS and no other package of the project.

- `fast_dds`: how a process leaves DDS without hanging in it
- `faults`: what is to fail in a run, and what did
- `files`: JSON and text files that are never seen half written
- `located_yaml`: YAML whose errors name file and line
- `network`: TCP ports and DDS domains of this machine
- `processes`, `shared_memory`: the processes of a run, and what killed ones leave behind
- `record`: what a mission writes on the way, and followers read
- `robots`: a robot's folder, and what goes with its models
- `runs`: the runs that are under way
- `scenarios`: what can be flown
- `signals`: Ctrl-C once and twice
- `suggestions`: "did you mean"
"""
