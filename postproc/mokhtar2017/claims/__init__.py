"""What the paper claims of its figures, checked on the stores of `jobs/paper`; `table` has the claims."""
