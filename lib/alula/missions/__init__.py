"""Missions as Behaviour Trees whose leaves are skills: what every robot's mission is made of."""
