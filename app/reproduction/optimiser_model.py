"""A problem as general optimisers of vehicle routes take it: in whole numbers, with clients and depots."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.domain.problem import Problem
from app.simulation.arrays import Floats, ProblemArrays
from app.simulation.legs import UNREACHABLE
from app.simulation.stacks import alike
from app.simulation.visit import time_home

RESOLUTION = 1e5
"""Units of distance and of time that the problem's extent has; both optimisers count in integers."""

UNLIMITED = 2**40


class Model(NamedTuple):
    """A problem in integers: nodes are N targets, M current positions, M starting points and D bases.

    Attributes
    ----------
    clients
        (C,) the target of each client that is worth a visit.
    like
        (M,) the first UAV with the same position, speed, range and loads.
    distance, duration, charged
        By UAV, (nodes, nodes): flown, passed (service with the leg to it), and paid for; legs home are 0
        where they do not count.
    longest
        (M,) what may be flown.
    earliest, latest
        (N,) times at which service may end.
    ready, until
        (M,) when a UAV sets out, and has to have landed.
    turnaround
        (D,) at the bases.
    prize, share
        (C,) reward, and share of the target's need.
    load, need
        (M, K) and (C, K).
    most_clients
        Of one target.
    """

    clients: list[int]
    like: list[int]
    distance: dict[int, Floats]
    duration: dict[int, Floats]
    charged: dict[int, Floats]
    longest: Floats
    earliest: Floats
    latest: Floats
    ready: Floats
    until: Floats
    turnaround: Floats
    prize: Floats
    share: Floats
    load: Floats
    need: Floats
    most_clients: int


def model_of(problem: Problem, arrays: ProblemArrays, *, by_material: bool) -> Model:
    """Write a problem in whole numbers.

    Parameters
    ----------
    problem, arrays
        The problem, and the same as a stack of one, with or without reloads.
    by_material
        Whether each material of an area is a client of its own.
    """
    m, n, k = arrays.shape
    nodes = n + 2 * m + arrays.n_bases
    # Stops as nodes: the bases come last.
    stops = np.concatenate([np.arange(n), n + 2 * m + np.arange(arrays.n_bases)])
    own = np.concatenate([np.arange(n), n + 1 + np.arange(arrays.n_bases)])
    per_distance = RESOLUTION / max(problem.extent, 1e-9)
    per_time = per_distance * float(arrays.uavs["speed"].mean())
    amounts = 1000 if max(arrays.load.max(), arrays.need.max()) < 1e6 else 1
    like = alike(arrays).tolist()
    distance, duration, charged = {}, {}, {}
    service = np.zeros((nodes, nodes))
    service[:, :n] = arrays.areas["service"][0]
    np.fill_diagonal(service, 0.0)
    for i in set(like):
        legs = np.zeros((nodes, nodes))
        uav = arrays.uavs[0, i]
        legs[np.ix_(stops, stops)] = arrays.between[0, uav["leg_class"]][np.ix_(own, own)]
        legs[n + i, stops] = arrays.start_target[0, i, own]
        times = legs / uav["speed"]
        if arrays.terms["timed"][0]:
            times[np.ix_(stops, stops)] = arrays.between_time[0, uav["leg_class"]][np.ix_(own, own)]
            times[n + i, stops] = arrays.start_time[0, i, own]
        barred = stops[arrays.kept_range[0, i, own] >= UNREACHABLE]
        for matrix in (legs, times):
            matrix[:, barred] = UNREACHABLE
            np.fill_diagonal(matrix, 0.0)
        home = legs.copy()
        home[stops, n + m + i] = arrays.home[0, i, own]
        if arrays.n_bases and problem.objective.return_to_base:
            times[stops, n + m + i] = [time_home(arrays, 0, i, j) for j in own.tolist()]
        distance[i] = _whole(per_distance * (home if problem.objective.return_to_base else legs))
        duration[i] = _whole(per_time * (times + service))
        paid = home if problem.objective.charge_return else legs
        charged[i] = np.minimum(paid, UNLIMITED / per_distance)
    latest = np.where(
        np.isfinite(arrays.areas["deadline"][0]), arrays.areas["deadline"][0] * per_time, UNLIMITED
    )
    total, opens = arrays.areas["need_total"][0], arrays.areas["earliest"][0]
    worth = [j for j in range(n) if total[j] > 0 and arrays.areas["level"][0, j] > 0 and latest[j] >= 0]
    need = np.ceil(amounts * arrays.need[0] - 1e-9)
    clients, needs = worth, need[worth]
    if by_material:
        pairs = [(j, material) for j in worth for material in range(k) if need[j, material] > 0]
        clients = [j for j, _ in pairs]
        needs = np.array([np.where(np.arange(k) == material, need[j], 0) for j, material in pairs])
    share = needs.reshape(-1, k).sum(axis=1) / np.maximum(need[clients].reshape(-1, k).sum(axis=1), 1)
    return Model(
        clients=clients,
        like=like,
        distance=distance,
        duration=duration,
        charged=charged,
        longest=np.maximum(0, np.floor(per_distance * (arrays.uavs["voyage"][0] - arrays.uavs["dis"][0]))),
        earliest=_whole(per_time * np.where(opens > 0, opens + arrays.areas["service"][0], 0.0)),
        latest=np.floor(latest + np.ceil(per_time * arrays.areas["service"][0])),
        ready=_whole(per_time * arrays.uavs["ready"][0]),
        until=np.floor(np.minimum(per_time * arrays.uavs["until"][0], UNLIMITED)),
        turnaround=_whole(per_time * arrays.bases["turnaround"][0]),
        prize=arrays.areas["level"][0][clients] * share,
        share=share,
        load=np.floor(amounts * (arrays.full if arrays.n_bases else arrays.load)[0] + 1e-9),
        need=needs,
        most_clients=max((clients.count(j) for j in worth), default=1),
    )


def _whole(units: Floats) -> Floats:
    """Return whole units, rounded up; what is longer than anything may be is that long."""
    return np.minimum(np.ceil(units), UNLIMITED)
