"""General optimisers of vehicle routes, given our problems as well as their models allow; to compare with.

Both are told of every UAV's position, range, speed, loads and step limit, of service times, of when areas
open and close and UAVs are ready, of zones and matrices as distances, of skills and exclusions as legs that
are not there, and maximise prizes less distance. A client of theirs is served in one visit and in full, or
not at all, so each gets two models, half of the time for either, and the better plan counts (one, where they
are the same):

- an area is a client, for the whole reward, and is served by one UAV;
- each material of an area is a client of its own, for its part of the reward, at the same place. So UAVs
  share areas, and an area may get one material of several.

They cannot express

- a part of a material (materials cut in two to four were tried: more often worse, as there are more clients);
- that a visit unloads whatever is there: plans are flown by our rule, which may leave nothing for a visit
  that was meant to bring it; such visits are left out, and those that a step limit has no place for;
- in PyVRP, that several clients are served in one visit: where materials are clients, the limit of steps is
  as many times as large as there are materials;
- in PyVRP, where distance is charged but not the leg home, a cost of distance: the cost is that of time at
  the UAV's speed, so service times are charged too, and given back through the prizes at the mean speed, and
  so is waiting;
- a range by flight, and stocks: with bases PyVRP reloads as often as it likes, whatever the distance, and
  OR-Tools does not;
- endurance, commitments, wind's air lengths, what decays, first shares, makespan and changes: plans are flown
  by our rules, and visits that these forbid are left out.

They are extras: ``pip install -e ".[compare]"``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib.util import find_spec

import numpy as np

from app.domain.plan import Plan
from app.domain.problem import Problem
from app.reproduction.errors import MissingPackage
from app.reproduction.optimiser_model import RESOLUTION, UNLIMITED, Model, model_of
from app.simulation.arrays import Floats, ProblemArrays, compile_problem
from app.simulation.evaluation import reward_of
from app.simulation.legs import UNREACHABLE
from app.simulation.simulator import act, end_step, new_episodes, verdict
from app.simulation.stacks import without_reloads
from app.simulation.visit import ALLOWED

_VISIT = 1000
"""Units of a visit in PyVRP, where one unit too many costs 1e5 at most: less than the prize of a client."""


def require(package: str) -> None:
    """Refuse to go on without a package.

    Raises
    ------
    MissingPackage
        If it is not installed.
    """
    if find_spec(package) is None:
        raise MissingPackage(f'{package} is not installed: .venv/bin/pip install -e ".[compare]"')


def _better_plan(
    problem: Problem,
    seconds: float,
    solve: Callable[[ProblemArrays, Model, float], list[list[int]]],
    *,
    reloads: bool,
) -> Plan:
    """Solve both models in half of the time each, if they differ; return the better plan, by its reward."""
    arrays = compile_problem(problem)
    if not reloads:
        arrays = without_reloads(arrays)
    empty = Plan.empty(problem.n_uavs, problem.n_targets)
    models = [model_of(problem, arrays, by_material=by_material) for by_material in (False, True)]
    if not models[0].clients or all(uav.ret for uav in problem.uavs):
        return empty
    if models[1].most_clients == 1:
        models.pop()
    routes = [solve(arrays, model, seconds / len(models)) for model in models]
    return max(
        (empty, *(_flown(problem, arrays, each) for each in routes)), key=lambda p: reward_of(problem, p)
    )


def _flown(problem: Problem, arrays: ProblemArrays, routes: list[list[int]]) -> Plan:
    """Fly routes by the rules of the simulator, without the visits that they do not allow."""
    actions = np.full((problem.max_steps, problem.n_uavs), problem.n_targets, np.int64)
    episodes = new_episodes(arrays, 1)
    left = [list(reversed(route)) for route in routes]
    for row in actions:
        if episodes.done[0]:
            break
        for i, route in enumerate(left):
            while route and verdict(arrays, episodes, 0, i, route[-1]) != ALLOWED:
                route.pop()
            if route:
                row[i] = route.pop()
            act(arrays, episodes, 0, i, row[i])
        end_step(arrays, episodes, 0)
    return Plan.of(actions, problem.n_targets)


def pyvrp_plan(problem: Problem, seconds: float, seed: int) -> Plan:
    """Return PyVRP's plan: heterogeneous vehicles, optional clients with prizes, time windows."""

    def solve(arrays: ProblemArrays, model: Model, seconds: float) -> list[list[int]]:
        return _pyvrp_routes(problem, arrays, model, seconds, seed)

    return _better_plan(problem, seconds, solve, reloads=True)


def _pyvrp_routes(
    problem: Problem, arrays: ProblemArrays, model: Model, seconds: float, seed: int
) -> list[list[int]]:
    import pyvrp  # noqa: PLC0415 - an extra
    from pyvrp.stop import MaxRuntime  # noqa: PLC0415 - an extra

    m, n, _ = arrays.shape
    weight, speeds = float(arrays.terms["weight"][0]), arrays.uavs["speed"][0]
    per_distance = RESOLUTION / max(problem.extent, 1e-9)
    # Prizes must not be worth more than the penalties, of 1e5 a unit at most, that keep routes feasible.
    scale = 1e7 / max(float(arrays.areas["level"].max()), 1e-12)
    unit = {i: weight * speeds[i] / speeds.mean() / per_distance for i in model.distance}
    members = {
        i: [q for q in range(m) if model.like[q] == i and not problem.uavs[q].ret] for i in model.distance
    }
    types = sorted(i for i in members if members[i])
    # Time passed costs what was flown in it; with charge_return the leg home takes time for the same reason.
    durations = [
        np.where(
            (model.charged[i] > 0) & (model.duration[i] == 0),
            np.ceil(model.charged[i] / speeds[i] * per_distance * speeds.mean()),
            model.duration[i],
        ).astype(np.int64)
        for i in types
    ]
    distances = [model.distance[i].astype(np.int64) for i in types]
    refund = weight * float(speeds.mean()) * arrays.areas["service"][0][model.clients] * model.share
    bases = arrays.n_bases
    if bases:
        # Nothing limits the distance of a route, so it can be what is paid for; turnarounds cost nothing.
        distances = [np.ceil(model.charged[i] * per_distance).astype(np.int64) for i in types]
        durations = [model.duration[i].astype(np.int64) for i in types]
        refund = np.zeros(len(model.clients))
    locations = [pyvrp.Location(0, 0) for _ in range(n + 2 * m + bases)]
    depots = [pyvrp.Depot(n + q) for q in range(2 * m)]
    depots += [
        pyvrp.Depot(n + 2 * m + d, service_duration=int(time)) for d, time in enumerate(model.turnaround)
    ]
    clients = [
        pyvrp.Client(
            location=j,
            delivery=[*(int(amount) for amount in need), _VISIT],
            tw_early=int(min(model.earliest[j], model.latest[j])),
            tw_late=int(model.latest[j]),
            prize=round(scale * (prize + back)),
            required=False,
        )
        for j, need, prize, back in zip(model.clients, model.need, model.prize, refund, strict=True)
    ]
    vehicles = [
        pyvrp.VehicleType(
            num_available=len(members[i]),
            capacity=[
                *(int(amount) for amount in model.load[i]),
                _VISIT * problem.max_steps * model.most_clients,
            ],
            start_depot=i,
            end_depot=m + i,
            max_distance=UNLIMITED if bases else int(model.longest[i]),
            tw_early=int(model.ready[i]),
            tw_late=int(model.until[i]),
            # Who need not be anywhere early takes off later, rather than waits on the way.
            start_late=int(model.ready[i] if not model.earliest.any() else model.until[i]),
            reload_depots=[
                2 * m + d for d in range(bases) if arrays.kept_range[0, i, n + 1 + d] < UNREACHABLE
            ],
            # Where distance costs nothing it still breaks ties.
            unit_distance_cost=max(1, round(scale * weight / per_distance)) if bases else 0,
            unit_duration_cost=0 if bases else max(1, round(scale * unit[i])),
            profile=p,
        )
        for p, i in enumerate(types)
    ]
    data = pyvrp.ProblemData(locations, clients, depots, vehicles, distances, durations)
    found = pyvrp.solve(data, MaxRuntime(seconds), seed=seed, display=False).best
    free = {i: list(members[i]) for i in types}
    routes: list[list[int]] = [[] for _ in range(m)]
    if found.is_feasible():
        for route in found.routes():
            # Of the depots only those between are bases: the route begins and ends at others.
            stops = [
                model.clients[each.idx] if each.is_client() else n + 1 + each.idx - 2 * m
                for each in route
                if each.is_client() or each.idx >= 2 * m
            ]
            routes[free[types[route.vehicle_type()]].pop()] = stops
    return routes


def routing_plan(problem: Problem, seconds: float, seed: int) -> Plan:  # noqa: ARG001 - it draws nothing
    """Return the plan of OR-Tools routing: guided local search, disjunctions with penalties."""

    def solve(arrays: ProblemArrays, model: Model, seconds: float) -> list[list[int]]:
        return _routing_routes(problem, arrays, model, seconds)

    return _better_plan(problem, seconds, solve, reloads=False)


def _routing_routes(problem: Problem, arrays: ProblemArrays, model: Model, seconds: float) -> list[list[int]]:
    from ortools.constraint_solver import pywrapcp, routing_enums_pb2  # noqa: PLC0415 - an extra

    m, n, k = arrays.shape
    out = [i for i in range(m) if not problem.uavs[i].ret]
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
    weight = float(arrays.terms["weight"][0])

    def registered(matrix: Floats) -> int:
        return int(model_.RegisterTransitMatrix(np.rint(matrix).astype(np.int64).tolist()))

    known: dict[tuple[str, int], int] = {}

    def of_uav(name: str, i: int) -> int:
        like = model.like[i]
        # Nodes of the depots are each UAV's own, so only what is between targets could be shared.
        matrix = {
            "cost": scale * weight * model.charged[like][chosen],
            "distance": model.distance[like][chosen],
            "time": model.duration[like][chosen],
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
    slack = UNLIMITED if model.earliest.any() else 0
    model_.AddDimensionWithVehicleTransits(
        [of_uav("time", i) for i in out], slack, UNLIMITED, not model.ready.any(), "time"
    )
    times = model_.GetDimensionOrDie("time")
    for q, i in enumerate(out):
        times.CumulVar(model_.Start(q)).SetMin(int(model.ready[i]))
    visits = registered(np.not_equal.outer(nodes, nodes) * (np.array(nodes) < n))
    model_.AddDimension(visits, 0, problem.max_steps, True, "visits")
    for each in range(k):
        taken = [int(amount) for amount in model.need[:, each]] + [0] * (2 * len(out))
        index = model_.RegisterUnaryTransitVector(taken)
        room = [int(model.load[i, each]) for i in out]
        model_.AddDimensionWithVehicleCapacity(index, 0, room, True, f"load {each}")
    for c, j in enumerate(model.clients):
        node = manager.NodeToIndex(c)
        model_.AddDisjunction([node], round(scale * model.prize[c]))
        times.CumulVar(node).SetRange(int(min(model.earliest[j], model.latest[j])), int(model.latest[j]))
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
    return routes
