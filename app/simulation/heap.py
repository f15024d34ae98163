"""Slots in a binary heap: the earliest comes out first. Who uses one keeps its length."""

from __future__ import annotations

from app.simulation.arrays import Integers
from app.simulation.decorators import compiled


@compiled
def push(heap: Integers, length: int, slot: int) -> None:
    """Put a slot on a heap of some length, which is one more then."""
    place = length
    while place > 0 and heap[(place - 1) // 2] > slot:
        heap[place] = heap[(place - 1) // 2]
        place = (place - 1) // 2
    heap[place] = slot


@compiled
def pop(heap: Integers, length: int) -> int:
    """Take the earliest slot off a heap of some length, at least 1, which is one less then."""
    top = int(heap[0])
    size = length - 1
    last, place = heap[size], 0
    while True:
        child = 2 * place + 1
        if child >= size:
            break
        if child + 1 < size and heap[child + 1] < heap[child]:
            child += 1
        if heap[child] >= last:
            break
        heap[place] = heap[child]
        place = child
    heap[place] = last
    return top
