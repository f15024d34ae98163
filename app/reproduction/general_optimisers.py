"""General optimisers of vehicle routes, given our problems as well as their models allow; to compare with.

Both are told of every UAV's position, range, speed, loads and step limit, of service times and deadlines, and
maximise prizes less distance. Both lack deliveries paid by the fraction met: an area is served in one visit
and in full, or not at all. So they cannot express

- a visit that brings part of what is needed, or one material of several, for part of the reward;
- two UAVs that share an area;
- in PyVRP, where distance is charged but not the leg home, a cost of distance: the cost is that of time at
  the UAV's speed, so service times are charged too, and given back through the prizes at the mean speed.

They are extras: ``pip install -e ".[compare]"``.
"""

from __future__ import annotations

import math
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

from app.domain.plan import Plan
from app.domain.problem import Problem
from app.reproduction.errors import MissingPackage
from app.simulation.arrays import Floats, ProblemArrays, compile_problem

_RESOLUTION = 1e5
"""Units of distance and of time that the problem's extent has; both optimisers count in integers."""

_UNLIMITED = 2**40


def require(package: str) -> None:
    """Refuse to go on without a package.

    Raises
    ------
    MissingPackage
        If it is not installed.
    """
    if find_spec(package) is None:
        raise MissingPackage(f'{package} is not installed: .venv/bin/pip install -e ".[compare]"')


class _Model(NamedTuple):
    """A problem in integers: nodes are N targets, M current positions and M starting points.

    Attributes
    ----------
    clients
        Targets that are worth a visit.
    like
        (M,) the first UAV with the same position, speed, range and loads.
    distance, duration, charged
        By UAV, (nodes, nodes): flown, passed, and paid for; legs home are 0 where they do not count.
    longest
        (M,) what may be flown.
    service, latest, prize
        (N,) times and level.
    load, need
        (M, K) and (N, K).
    prize_scale
        Units of an integer prize that a reward of 1 has.
    """

    clients: list[int]
    like: list[int]
    distance: dict[int, Floats]
    duration: dict[int, Floats]
    charged: dict[int, Floats]
    longest: Floats
    service: Floats
    latest: Floats
    prize: Floats
    load: Floats
    need: Floats


def _model(problem: Problem, arrays: ProblemArrays) -> _Model:
    m, n, _ = arrays.shape
    per_distance = _RESOLUTION / max(problem.extent, 1e-9)
    speed = float(arrays.speed.mean())
    per_time = per_distance * speed
    amounts = 1000 if max(arrays.load.max(), arrays.need.max()) < 1e6 else 1
    like: list[int] = []
    seen: dict[Any, int] = {}
    for i, uav in enumerate(problem.uavs):
        key = (uav.x_c, uav.y_c, uav.x_s, uav.y_s, uav.speed, uav.voyage - uav.dis, uav.loadlist, uav.ret)
        like.append(seen.setdefault(key, i))
    distance, duration, charged = {}, {}, {}
    for i in set(like):
        legs = np.zeros((n + 2 * m, n + 2 * m))
        legs[:n, :n] = arrays.between[0]
        legs[n + i, :n] = arrays.start_target[0, i]
        home = legs.copy()
        home[:n, n + m + i] = arrays.home[0, i]
        distance[i] = np.ceil(per_distance * (home if problem.objective.return_to_base else legs))
        duration[i] = np.ceil(per_time * legs / arrays.speed[0, i])
        charged[i] = home if problem.objective.charge_return else legs
    latest = np.where(np.isfinite(arrays.deadline[0]), arrays.deadline[0] * per_time, _UNLIMITED)
    return _Model(
        clients=[
            j for j in range(n) if arrays.need_total[0, j] > 0 and arrays.level[0, j] > 0 and latest[j] >= 0
        ],
        like=like,
        distance=distance,
        duration=duration,
        charged=charged,
        longest=np.maximum(0, np.floor(per_distance * (arrays.voyage[0] - arrays.dis[0]))),
        service=np.ceil(per_time * arrays.service[0]),
        latest=np.floor(latest),
        prize=arrays.level[0],
        load=np.floor(amounts * arrays.load[0] + 1e-9),
        need=np.ceil(amounts * arrays.need[0] - 1e-9),
    )


def _plan(problem: Problem, routes: list[list[int]]) -> Plan:
    actions = np.full((problem.max_steps, problem.n_uavs), problem.n_targets, np.int64)
    for i, route in enumerate(routes):
        actions[: len(route), i] = route
    return Plan.of(actions, problem.n_targets)


def pyvrp_plan(problem: Problem, seconds: float, seed: int) -> Plan:
    """Return PyVRP's plan: heterogeneous vehicles, optional clients with prizes, time windows."""
    import pyvrp  # noqa: PLC0415 - an extra
    from pyvrp.stop import MaxRuntime  # noqa: PLC0415

    arrays = compile_problem(problem)
    m, n, _ = arrays.shape
    model = _model(problem, arrays)
    weight = float(arrays.weight[0])
    # Prizes must not be worth more than the penalties, of 1e5 a unit at most, that keep routes feasible.
    scale = 1e7 / max(float(arrays.level.max()), 1e-12)
    speeds = arrays.speed[0]
    unit = {
        i: weight * speeds[i] / speeds.mean() / (_RESOLUTION / max(problem.extent, 1e-9))
        for i in model.distance
    }
    types = sorted(set(model.like))
    members = {i: [q for q in range(m) if model.like[q] == i and not problem.uavs[q].ret] for i in types}
    types = [i for i in types if members[i]]
    if not types or not model.clients:
        return Plan.empty(m, n)
    # Time passed costs what was flown in it; with charge_return the leg home takes time for the same reason.
    durations = [
        np.where(
            (model.charged[i] > 0) & (model.duration[i] == 0),
            np.ceil(
                model.charged[i]
                / arrays.speed[0, i]
                * _RESOLUTION
                / max(problem.extent, 1e-9)
                * speeds.mean()
            ),
            model.duration[i],
        ).astype(np.int64)
        for i in types
    ]
    refund = weight * float(speeds.mean()) * arrays.service[0]
    locations = [pyvrp.Location(0, 0) for _ in range(n + 2 * m)]
    depots = [pyvrp.Depot(n + q) for q in range(2 * m)]
    clients = [
        pyvrp.Client(
            location=j,
            delivery=[*(int(amount) for amount in model.need[j]), 1],
            service_duration=int(model.service[j]),
            # A time window is about the beginning of service.
            tw_late=int(model.latest[j]),
            prize=round(scale * (model.prize[j] + refund[j])),
            required=False,
        )
        for j in model.clients
    ]
    vehicles = [
        pyvrp.VehicleType(
            num_available=len(members[i]),
            capacity=[*(int(amount) for amount in model.load[i]), problem.max_steps],
            start_depot=i,
            end_depot=m + i,
            max_distance=int(model.longest[i]),
            start_late=0,
            unit_distance_cost=0,
            # Where distance costs nothing it still breaks ties.
            unit_duration_cost=max(1, round(scale * unit[i])),
            profile=p,
        )
        for p, i in enumerate(types)
    ]
    data = pyvrp.ProblemData(
        locations, clients, depots, vehicles, [model.distance[i].astype(np.int64) for i in types], durations
    )
    found = pyvrp.solve(data, MaxRuntime(seconds), seed=seed, display=False).best
    free = {i: list(uavs) for i, uavs in members.items()}
    routes: list[list[int]] = [[] for _ in range(m)]
    if found.is_feasible():
        for route in found.routes():
            routes[free[types[route.vehicle_type()]].pop()] = [model.clients[c] for c in _clients(route)]
    return _plan(problem, routes)


def _clients(route: Any) -> list[int]:
    return [each.idx for each in route if each.is_client()]


def routing_plan(problem: Problem, seconds: float, seed: int) -> Plan:  # noqa: ARG001 - it draws nothing
    """Return the plan of OR-Tools routing: guided local search, disjunctions with penalties."""
    from ortools.constraint_solver import pywrapcp, routing_enums_pb2  # noqa: PLC0415 - an extra

    arrays = compile_problem(problem)
    m, n, k = arrays.shape
    model = _model(problem, arrays)
    out = [i for i in range(m) if not problem.uavs[i].ret]
    if not out or not model.clients:
        return Plan.empty(m, n)
    scale = 1e6
    nodes = [*model.clients, *(n + i for i in out), *(n + m + i for i in out)]
    count = len(model.clients)
    manager = pywrapcp.RoutingIndexManager(
        len(nodes),
        len(out),
        [count + q for q in range(len(out))],
        [count + len(out) + q for q in range(len(out))],
    )
    model_ = pywrapcp.RoutingModel(manager)
    chosen = np.ix_(nodes, nodes)
    weight = float(arrays.weight[0])

    def registered(matrix: Floats) -> int:
        return int(model_.RegisterTransitMatrix(np.rint(matrix).astype(np.int64).tolist()))

    known: dict[tuple[str, int], int] = {}

    def of_uav(name: str, i: int) -> int:
        like = model.like[i]
        # Nodes of the depots are each UAV's own, so only what is between targets could be shared.
        matrix = {
            "cost": scale * weight * model.charged[like][chosen],
            "distance": model.distance[like][chosen],
            "time": model.duration[like][chosen] + np.append(model.service, np.zeros(2 * m))[nodes][:, None],
        }[name]
        if like != i:
            rows, columns = count + out.index(i), count + len(out) + out.index(i)
            first = out.index(like)
            matrix = matrix.copy()
            matrix[rows], matrix[:, columns] = matrix[count + first], matrix[:, count + len(out) + first]
        return known.setdefault((name, i), registered(matrix))

    for q, i in enumerate(out):
        model_.SetArcCostEvaluatorOfVehicle(of_uav("cost", i), q)
    longest = [int(model.longest[i]) for i in out]
    model_.AddDimensionWithVehicleTransitAndCapacity(
        [of_uav("distance", i) for i in out], 0, longest, True, "distance"
    )
    model_.AddDimensionWithVehicleTransits([of_uav("time", i) for i in out], 0, _UNLIMITED, True, "time")
    times = model_.GetDimensionOrDie("time")
    for each in range(k + 1):
        taken = [1] * count if each == k else [int(model.need[j, each]) for j in model.clients]
        room = [problem.max_steps] * len(out) if each == k else [int(model.load[i, each]) for i in out]
        taken += [0] * (2 * len(out))
        index = model_.RegisterUnaryTransitVector(taken)
        model_.AddDimensionWithVehicleCapacity(index, 0, room, True, f"load {each}")
    for c, j in enumerate(model.clients):
        node = manager.NodeToIndex(c)
        model_.AddDisjunction([node], round(scale * model.prize[j]))
        times.CumulVar(node).SetMax(int(model.latest[j]))
    options = pywrapcp.DefaultRoutingSearchParameters()
    options.first_solution_strategy = routing_enums_pb2.FirstSolutionStrategy.PARALLEL_CHEAPEST_INSERTION
    options.local_search_metaheuristic = routing_enums_pb2.LocalSearchMetaheuristic.GUIDED_LOCAL_SEARCH
    options.time_limit.FromMilliseconds(math.ceil(1000 * seconds))
    found = model_.SolveWithParameters(options)
    routes: list[list[int]] = [[] for _ in range(m)]
    if found is not None:
        for q, i in enumerate(out):
            at = found.Value(model_.NextVar(model_.Start(q)))
            while not model_.IsEnd(at):
                routes[i].append(model.clients[manager.IndexToNode(at)])
                at = found.Value(model_.NextVar(at))
    return _plan(problem, routes)
