"""Compiled code of an earlier version is no reason to fail: what it was compiled for may have other names now.

numba keeps with each compiled function the types of its arguments, among them our named tuples, and reads them before
it looks whether the function is still the same. Imported by the packages that have compiled functions.
"""

import pickle
from collections.abc import Callable
from typing import Any

from numba.core.caching import IndexDataCacheFile

_load_index: Callable[[IndexDataCacheFile], dict[Any, str]] = IndexDataCacheFile._load_index


def _load_index_or_nothing(file: IndexDataCacheFile) -> dict[Any, str]:
    """Return the index of a function's compiled code, empty where it names what is not there any more."""
    try:
        return _load_index(file)
    except (AttributeError, ImportError, pickle.UnpicklingError):
        return {}


IndexDataCacheFile._load_index = _load_index_or_nothing  # type: ignore[method-assign]
