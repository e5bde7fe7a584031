"""Compilation of scalar functions by numba where it is installed; plain Python otherwise."""

try:
    from numba import njit

    compiled = njit(cache=True, error_model="numpy")
except ImportError:  # slower by a factor of 100, with the same numbers

    def compiled(function):
        """Returns the function as it is."""
        return function
