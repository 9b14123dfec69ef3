"""Errors that reach the user: one line with where, what is wrong and how to fix it, and an exit code."""


def printable(text: str) -> str:
    """Return a text as one line that is safe on a terminal: white space as blanks, other controls escaped."""
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() else " " if c.isspace() else c.encode("unicode_escape").decode() for c in text
    )


class RubError(Exception):
    """An error that the user can fix; its text is one line, without control characters."""

    exit_code = 1

    def __init__(self, text: str = "") -> None:
        super().__init__(printable(text))


class InputError(RubError):
    """A study, a rig or an argument that is invalid."""

    exit_code = 2


class NoPeriodicMotion(RubError):  # noqa: N818 - it is named for what was asked for
    """A search for a periodic motion that found none; its text says why."""


class StoreError(RubError):
    """A store that cannot be used: of another study, locked, full, read-only or damaged."""

    exit_code = 3


class StoppedEarly(RubError):  # noqa: N818 - it is a state, not an error
    """A run that stopped on request before its end; the same command resumes it."""

    exit_code = 75
