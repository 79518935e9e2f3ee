"""Judges what the FMUs produce: co-simulation, trajectories on disk, references, findings, figures, report."""

import os

# Matrices here have some twenty rows: more threads only wait for each other (500 exponentials: 0.14 s, with two 5 s).
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read when numpy is loaded
