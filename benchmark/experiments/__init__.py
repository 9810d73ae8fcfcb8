"""One experiment of the benchmark each."""
