"""The simulated rover: wheels, laser, bumper, battery, doors and a person, on a floor of IR-SIM."""
