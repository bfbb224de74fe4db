"""A study becomes cases: what each is, which stands for which, what is left to solve."""
