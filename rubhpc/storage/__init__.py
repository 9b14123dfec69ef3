"""The store on disk: arrays, journals, lock, verification."""
