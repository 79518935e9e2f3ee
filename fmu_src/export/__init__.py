"""What is needed to make an FMU and never while one steps: drawings, documentation, reference results.

`build.py` leaves this package out of the FMUs; nothing else in `fmu_src` imports it (import-linter checks).
"""
