"""The contact modes that one case has met, from a library that all cases of a set-up share."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rubhpc.integrate.reduced_model.mode_library import ModeLibrary
    from rubhpc.kernels.contact_modes import ModeTables

FORESEEN, MOST_FORESEEN = 8, 4  # pieces at whose beginning a recent set of contacts is solved; most sets
MOST_REFILLS = 4  # of the tables by one case; with more, collocation costs less


class NoClosedForm(Exception):  # noqa: N818 - a state of the motion, never seen by users
    """The motion needs collocation.

    Contacts open and close without end, or in too many combinations.
    """


class MetModes:
    """Sets of closed contacts that a case has met, and the library that holds them.

    The kernel must not depend on what other cases have left in the library: it sees only sets that this case
    has met.
    """

    def __init__(self) -> None:
        """Begin with no library."""
        self._n_piece = -1
        self._asked: dict[int, int] = {}  # piece in which each set of contacts was last requested

    def begin_piece(self, measured: ModeLibrary) -> None:
        """Begin at another speed, or for the first time, with the library of that speed."""
        self._n_piece += 1
        self._asked = {mask: n for mask, n in self._asked.items() if self._n_piece - n <= FORESEEN}
        self._measured = measured
        self.library = measured.followed
        self.met = set(self.library.first_masks)
        if measured.is_tuned_ahead:
            for foreseen in list(self._asked)[-MOST_FORESEEN:]:
                self._add(foreseen)

    def library_for(self, *, is_recorded: bool) -> ModeLibrary:
        """Contact modes to record a motion, or only to follow it."""
        return self._measured if is_recorded else self._measured.followed

    def ask_for(self, mask: int) -> None:
        """Register a set of contacts that the case had not met."""
        self._asked.pop(mask, None)
        self._asked[mask] = self._n_piece  # ordered by the last request

    def tables_with(self, mask: int) -> ModeTables:
        """Return the tables of the sets that this case has met, and of one more.

        Raises
        ------
        NoClosedForm
            It has met too many.
        """
        self._add(mask)
        tables, unmet = self.library.tables(), self.library.unmet(self.met)
        if unmet:
            shown = tables.mask.copy()
            shown[unmet] = -1
            tables = tables._replace(mask=shown)
        return tables

    def _add(self, mask: int) -> None:
        """Ensure that the library contains a set of contacts."""
        self.met.add(mask)
        if len(self.met) > MOST_REFILLS * self._measured.followed.n_usual:
            raise NoClosedForm
        if mask not in self.library.masks:
            if self.library.is_full:
                self.library.make_room()
            if not self.library.add(mask):
                raise NoClosedForm
