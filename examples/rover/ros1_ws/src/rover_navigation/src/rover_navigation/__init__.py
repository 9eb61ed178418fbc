"""Map, localisation, navigation and health of the rover: pure modules, and thin nodes around them."""
