"""What only the drone's reports have: the map against the true world, the clearance, the video, and what the functional layer recorded."""
