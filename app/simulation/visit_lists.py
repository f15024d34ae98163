"""The visits of each target as linked lists: one moves to another target; what they connect is found."""

from __future__ import annotations

from app.simulation.arrays import NONE, Integers
from app.simulation.decorators import compiled
from app.simulation.deliveries import Unloading, Visits
from app.simulation.insertion import CHANGED, MARK


@compiled
def move_slot(visits: Visits, slot: int, old: int, new: int) -> None:
    """Take a slot out of one target's list and put it in its order into another's; NONE is no target."""
    if old != NONE:
        if visits.first[old] == slot:
            visits.first[old] = visits.following[slot]
        else:
            at = visits.first[old]
            while visits.following[at] != slot:
                at = visits.following[at]
            visits.following[at] = visits.following[slot]
    if new != NONE:
        if visits.first[new] == NONE or visits.first[new] > slot:
            visits.following[slot] = visits.first[new]
            visits.first[new] = slot
        else:
            at = visits.first[new]
            while visits.following[at] != NONE and visits.following[at] < slot:
                at = visits.following[at]
            visits.following[slot] = visits.following[at]
            visits.following[at] = slot


@compiled
def connected(
    visits: Visits,
    routes: Integers,
    unloading: Unloading,
    uav_mark: Integers,
    target_mark: Integers,
    changed: Integers,
    tally: Integers,
    i: int,
    j: int,
) -> int:
    """List the targets that visits connect with the additional one, by their rank, and their UAVs."""
    served, order, rank = unloading.served, unloading.order, unloading.rank
    tally[MARK] += 1
    mark = tally[MARK]
    m = visits.length.shape[0]
    served[0], target_mark[j] = j, mark
    changed[0], uav_mark[i] = i, mark
    uavs, found, seen, head = 1, 1, 0, 0
    while True:
        # First the routes of all UAVs that are known, then the UAVs of all targets that are known.
        while seen < uavs:
            h = changed[seen]
            for s in range(visits.length[h]):
                # What the plan has in a visit that is given up is concerned, too; the last one is additional.
                x = visits.target[h, s] if h != i or s == visits.length[h] - 1 else routes[h, s]
                if target_mark[x] != mark:
                    target_mark[x] = mark
                    served[found] = x
                    found += 1
            seen += 1
        if head == found:
            break
        slot = visits.first[served[head]]
        while slot != NONE:
            if uav_mark[slot % m] != mark:
                uav_mark[slot % m] = mark
                changed[uavs] = slot % m
                uavs += 1
            slot = visits.following[slot]
        head += 1
    tally[CHANGED] = uavs
    if found * found > order.shape[0]:
        q = 0
        for position in range(order.shape[0]):
            if target_mark[order[position]] == mark:
                served[q] = order[position]
                q += 1
        return found
    for q in range(1, found):
        x, position = served[q], q
        while position > 0 and rank[served[position - 1]] > rank[x]:
            served[position] = served[position - 1]
            position -= 1
        served[position] = x
    return found
