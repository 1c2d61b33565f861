"""The arrays of a page, read as `unpack` of plot.js reads them."""

import base64
import zlib

import numpy as np


def unpacked(sheet, number):
    """Return one column of a page."""
    body = np.frombuffer(zlib.decompress(base64.b64decode(sheet["bytes"])), np.uint8)
    start = 4 * sum(head[0] for head in sheet["columns"][:number])
    count, step, origin = sheet["columns"][number]
    differences = body[start : start + 4 * count].reshape(4, count).T.copy().view("<i4").ravel()
    with np.errstate(over="ignore"):
        steps = np.cumsum(differences, dtype=np.int32)
    return np.where(steps == -(2**31), np.nan, origin + steps * step)
