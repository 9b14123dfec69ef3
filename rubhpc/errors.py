"""Errors that reach the user: one line saying what, where and the mend; each has its exit code."""


class RubError(Exception):
    """Anything the user can mend; its text is one line."""

    exit_code = 1


class InputError(RubError):
    """A study, a rig or an argument that cannot be used as it stands."""

    exit_code = 2


class StoreError(RubError):
    """A store that cannot be used: of another study, locked, full, read-only or damaged."""

    exit_code = 3


class StoppedEarly(RubError):  # noqa: N818 - it is a state, not a fault
    """A run that stopped on request before its end; the same command goes on."""

    exit_code = 75
