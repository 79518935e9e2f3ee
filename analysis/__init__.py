"""Judges what the FMUs produce: co-simulation, trajectories on disk, references, findings, figures, report."""
