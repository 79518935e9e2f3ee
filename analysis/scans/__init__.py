"""Resonances and the energy that modes exchange, over a parameter of the car or of the drive."""
