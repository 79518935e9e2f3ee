"""The road under the four wheels: profiles as functions of time, and their FMU."""
