"""Measuring speed: what `murmillo bench` and the benchmarks of the repository share."""
