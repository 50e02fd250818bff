"""Copies of arrays, compiled: numba's own ``a[:] = b`` takes a second longer to compile, for the words of its error."""

from numba import njit

from app.arrays import FloatArray


@njit(cache=True, nogil=True)
def copy_row(to: FloatArray, row: FloatArray) -> None:
    """Write ``row`` (n,) into ``to``, which is at least as long."""
    for i in range(len(row)):
        to[i] = row[i]


@njit(cache=True, nogil=True)
def copy_rows(to: FloatArray, rows: FloatArray) -> None:
    """Write ``rows`` (n, m) into ``to``, which has at least as many rows and columns."""
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            to[i, j] = rows[i, j]
