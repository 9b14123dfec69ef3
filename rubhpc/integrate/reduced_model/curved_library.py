"""The contact modes of a reduced model with curved gaps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rubhpc.integrate.reduced_model.curved_bodies import motion_rows
from rubhpc.integrate.reduced_model.curved_tables import tabulate_curved
from rubhpc.integrate.reduced_model.mode_library import ModeLibrary
from rubhpc.integrate.reduced_model.table_stack import TableStack

if TYPE_CHECKING:
    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.kernels.contact_modes import ModeTables
    from rubhpc.kernels.curved_contact import CurvedTables


class CurvedLibrary(ModeLibrary):
    """Contact modes of one speed and friction, with further tables for curved gaps."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self._row = motion_rows(args[0], args[1])
        self._curved: TableStack | None = None
        super().__init__(*args, **kwargs)

    @property
    def n_most(self) -> int:
        """Contact modes that there is room for."""
        return super().n_most if self._curved is None else min(super().n_most, self._curved.n_most)

    _is_parted = False  # tables of curved gaps do not depend on recording

    @property
    def n_byte(self) -> int:
        """Memory that its tables hold."""
        return super().n_byte + (0 if self._curved is None else self._curved.n_byte)

    def forget(self) -> None:
        """Make room: keep no mode but that with every pair open."""
        if self._curved is not None:
            self._curved.clear()
        super().forget()

    def make_room(self) -> None:
        """Forget all modes: curved gaps have further tables of each mode."""
        self.forget()

    def curved_tables(self) -> CurvedTables:
        """Further tables of all contact modes for curved gaps."""
        assert self._curved is not None
        tables: CurvedTables = self._curved.view()
        return tables

    def _friction_of(self, mode: ContactMode) -> None:
        """None: the direction of friction is that of the current normal."""

    def _tabulate(self, mode: ContactMode, row: ModeTables | None = None) -> None:
        super()._tabulate(mode, row)
        if self._curved is None:
            self._curved = TableStack(1 + len(self.gap_jacobian), self._most_modes)
        self._curved.add(
            tabulate_curved(
                mode,
                self.reduced,
                self._row,
                (self.gap_jacobian, self.force_direction),
                width=self.width,
                tick=self._tick,
                n_level=self._n_level,
            )
        )
