"""Compiled kernels: kept on disk, loaded without numba, and compiled by numba where missing."""
