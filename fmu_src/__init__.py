"""Everything an FMU needs while it steps: the car, the road, the controller, and the shell that speaks FMI.

The package is self-contained (relative imports only): `build.py` copies it into the resources of each FMU under a
name that carries the hash of its content, so that two versions can live in one host process.
"""
