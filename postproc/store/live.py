"""A store in its current state, also during a run: measures come from the journals until they are packed."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

from postproc.store.branch_points import is_of_points
from postproc.store.inferred import fill_inferred
from postproc.store.open import open_store
from rubhpc.storage.disk import disk_errors
from rubhpc.storage.lock import is_alive, read_holder
from rubhpc.storage.manifest import PRIVATE
from rubhpc.storage.resume import is_store
from rubhpc.storage.runs import read_runs
from rubhpc.storage.store import Store

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr


def open_live(path: Path) -> xr.Dataset:
    """Return the store as `open_store` does, with status and measures of every case in the journals.

    What only the journals contain becomes attributes: `reasons` (flat index of a case to why it failed
    or diverged), `runs` (machine, ranks and times of each) and `running` (who computes now; "" if nobody).
    A store without journals, such as a copy made with xarray, is returned unchanged.

    Raises
    ------
    StoreError
        There is no store, or it is damaged.
    """
    dataset = open_store(path)
    if not is_store(path):
        return dataset
    store = Store(path)
    with disk_errors(path):
        is_packed = store.is_packed()
        ledger = store.replay(with_measures=not is_packed)
        lock = path / PRIVATE / "lock"
        holder = read_holder(lock)
        holders = [holder] if holder is not None and is_alive(holder, lock) else store.parts.running()
        running = "; ".join(map(str, holders))
        runs = [asdict(run) for run in read_runs(path)]
    if not is_packed and not is_of_points(dataset):  # points have no values of cases
        packed = {name: (dataset[name], values) for name, values in store.packed_values(ledger).items()}
        dataset = dataset.assign(  # a run-up is opened without its axis of one speed
            {name: (was.dims, values.reshape(was.shape), was.attrs) for name, (was, values) in packed.items()}
        )
        dataset = fill_inferred(dataset, path)
    about_runs = {"reasons": dict(ledger.reasons), "runs": runs, "running": running}
    return dataset.assign_attrs(about_runs)
