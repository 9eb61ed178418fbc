"""What of a robot stays up between missions on one of its computers, as a deployment says: bridge, managers, recorder, page."""
