"""A 4-ary heap in two arrays: its smallest key comes first."""

from __future__ import annotations

from ..base.arrays import FloatArray, IntArray
from ..base.jit import compiled


@compiled
def push(keys: FloatArray, items: IntArray, size: int, key: float, item: int) -> int:
    """Insert an item into a 4-ary heap; return the new size of the heap."""
    i = size
    while i > 0:
        parent = (i - 1) >> 2
        if keys[parent] <= key:
            break
        keys[i] = keys[parent]
        items[i] = items[parent]
        i = parent
    keys[i] = key
    items[i] = item
    return size + 1


@compiled
def drop_first(keys: FloatArray, items: IntArray, size: int) -> int:
    """Remove the smallest item from a 4-ary heap; return the new size of the heap."""
    size -= 1
    key, item = keys[size], items[size]
    i = 0
    while True:
        first = 4 * i + 1
        if first >= size:
            break
        child, smallest = first, keys[first]
        for sibling in range(first + 1, min(first + 4, size)):
            if keys[sibling] < smallest:
                child, smallest = sibling, keys[sibling]
        if smallest >= key:
            break
        keys[i] = smallest
        items[i] = items[child]
        i = child
    keys[i] = key
    items[i] = item
    return size
