"""The two errors that a command reports in one line, without a traceback."""


class ConfigError(Exception):
    """The input is wrong; the message is one line. Commands exit with code 2."""


class RunError(RuntimeError):
    """The input was right, but the work failed; the message is one line. Commands exit with code 1."""
