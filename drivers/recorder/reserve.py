"""Room on the disk that is kept for the end of a file, so that a full disk costs no whole chunk."""

from __future__ import annotations

import ctypes
import errno
import os
from functools import cache
from typing import Any

_KEEP_SIZE = 1  # FALLOC_FL_KEEP_SIZE: blocks beyond the end, the file's size stays
_NOT_HERE = (errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL)


@cache
def _fallocate() -> Any:  # noqa: ANN401
    """Return the C library's fallocate, None where it has none."""
    try:
        function = ctypes.CDLL(None, use_errno=True).fallocate
    except (OSError, AttributeError):
        return None
    function.argtypes = [ctypes.c_int, ctypes.c_int, ctypes.c_int64, ctypes.c_int64]
    return function


def reserve(fd: int, offset: int, size: int) -> None:
    """Have the file system set these bytes aside for a file, without making it longer.

    Where it cannot do that nothing happens: then only the write itself finds the disk full.

    Raises: OSError when there is no room for them
    """
    function = _fallocate()
    if function is None or function(fd, _KEEP_SIZE, offset, size) == 0:
        return
    number = ctypes.get_errno()
    if number not in _NOT_HERE:
        raise OSError(number, os.strerror(number))
