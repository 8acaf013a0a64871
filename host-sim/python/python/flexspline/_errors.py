"""What can go wrong: every message names the argument, file, line or field, the value found and what is allowed."""


class FlexsplineError(Exception):
    """Whatever this package raises of its own."""


class BadInput(FlexsplineError, ValueError):
    """The input is to blame: an argument, a drive, a table, a log."""


class NotConverged(FlexsplineError, RuntimeError):
    """A run failed: an increment did not converge, the drive did not settle."""


class NothingGained(FlexsplineError, RuntimeError):
    """The logs make no table that is better than none."""
