"""Errors at run time that are told in one line."""


class RunError(RuntimeError):
    """Work cannot go on, through no fault of the input; the message is one line. Entry points end with exit code 1."""
