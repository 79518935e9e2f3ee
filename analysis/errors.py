"""Errors that end a command with one line: what, where, wanted, got, and what to do."""


class InputError(ValueError):
    """A file or an option that the user gave cannot be used."""


class CosimError(RuntimeError):
    """A co-simulation that could not be set up or carried to its end."""
