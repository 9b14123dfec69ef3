"""What the paper claims, each claim a function of the stores of `jobs/paper`; `index` lists them all."""
