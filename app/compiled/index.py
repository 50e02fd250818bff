"""Compiled code of an earlier version is neither used nor a reason to fail.

numba keeps compiled functions by the source of their own module, and does not see when another one changed whose
functions and constants were compiled into them: here both count. And it keeps the types of the arguments, among them
our named tuples, and reads them before it looks whether the function is still the same: they may have other names now.
Imported by the packages that have compiled functions.
"""

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba.core.caching import IndexDataCacheFile, _SourceFileBackedLocatorMixin

from app.compiled.sources import digest_of, is_ours

_load_index: Callable[[IndexDataCacheFile], dict[Any, str]] = IndexDataCacheFile._load_index
_stamp: Callable[[_SourceFileBackedLocatorMixin], object] = _SourceFileBackedLocatorMixin.get_source_stamp


def _load_index_or_nothing(file: IndexDataCacheFile) -> dict[Any, str]:
    """Return the index of a function's compiled code, empty where it names what is not there any more."""
    try:
        return _load_index(file)
    except (AttributeError, ImportError, pickle.UnpicklingError):
        return {}


def _stamp_of_all(locator: Any) -> object:
    """Return what the source of a function has to be for its compiled code to be used."""
    file = Path(locator._py_file).resolve()
    return digest_of(file) if is_ours(file) else _stamp(locator)


IndexDataCacheFile._load_index = _load_index_or_nothing  # type: ignore[method-assign]
_SourceFileBackedLocatorMixin.get_source_stamp = _stamp_of_all  # type: ignore[method-assign]
