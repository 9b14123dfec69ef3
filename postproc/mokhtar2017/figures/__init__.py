"""The figures of the paper, drawn from the stores of `jobs/paper` in its arrangement; `pages` has them."""
