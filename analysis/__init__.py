"""Judges what the FMUs produced: co-simulation, trajectories on disk, reference solutions, findings, figures, report."""
