"""Optimal stabilization (§4): the half car, its Riccati equation, the stored design, and the controller's FMU."""
