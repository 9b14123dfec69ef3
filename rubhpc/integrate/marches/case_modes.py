"""The contact modes that one case has met, from a library that all cases of a set-up share."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rubhpc.integrate.reduced_model.mode_library import ModeLibrary
    from rubhpc.kernels.contact_modes import ModeTables


class NoClosedForm(Exception):  # noqa: N818 - a state of the motion, never seen by users
    """The motion needs collocation.

    Contacts open and close without end, or in too many combinations.
    """


class CaseModes:
    """Sets of closed contacts that a case has met, and the library that holds them.

    The kernel must not depend on what other cases have left in the library: it sees only sets that this case
    has met.
    """

    def __init__(self, library: ModeLibrary) -> None:
        self.library = library
        self.met = set(library.first_masks)

    def tables_with(self, mask: int) -> ModeTables:
        """Return the tables of the sets that this case has met, and of one more.

        Raises
        ------
        NoClosedForm
            It has met too many.
        """
        library = self.library
        self.met.add(mask)
        if len(self.met) > library.n_most:
            raise NoClosedForm
        if mask not in library.masks:
            if library.is_full:
                library.forget()
            if not library.add(mask):
                raise NoClosedForm
        tables, unmet = library.tables(), library.unmet(self.met)
        if unmet:
            shown = tables.mask.copy()
            shown[unmet] = -1
            tables = tables._replace(mask=shown)
        return tables
