"""The experiments of the benchmark, one in each module, and methods that only they use."""
