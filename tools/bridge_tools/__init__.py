"""Tools around the bridge that do not ship with it: benchmark, soak, fuzzer, peers that misbehave."""
