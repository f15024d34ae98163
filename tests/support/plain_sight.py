"""What the policy for every size sees of a state, feature by feature in plain Python: a reading of the names.

Nothing here is shared with the compiled observation, nor are the rules, which are the referee's.
"""

from __future__ import annotations

import math

from plain_state import PlainState, clip, flat, share
from referee_legs import place_of


def uav_row(s: PlainState, i: int) -> dict[str, float]:
    craft, fleet, record = s.flight.fleet[i], s.flight.fleet, s.flight.fleet[i].record
    out = [each for each in fleet if each.out]
    nets = sorted((s.net(i, j) for j in range(s.n) if s.possible(i, j)), reverse=True)
    reloads = [reload_row(s, i, d) for d in range(s.d)]
    wanted = s.wanted()
    supply = [sum(each.hold[k] for each in out) for k in range(len(wanted))]
    covered = sum(map(min, wanted, supply))
    most = [
        max(carried, full) if s.d else carried for carried, full in zip(craft.loaded, craft.full, strict=True)
    ]
    left, objective = s.steps - s.step, s.objective
    half_life = objective.get("half_life")
    first = (objective.get("minimum_share") or 0.0) > 0
    return {
        "OUT": craft.out,
        "ACTED": i in s.acted,
        "VISITS": len(nets) / s.n,
        "BEST": s.squash(nets[0]) if nets else -1,
        "SECOND": s.squash(nets[1]) if len(nets) > 1 else -1,
        "LOAD_OF_MOST": share(sum(craft.hold), max((sum(each.hold) for each in out), default=0.0)),
        "LOAD_LEFT": share(sum(craft.hold), sum(most)),
        "LOAD_WANTED": share(sum(map(min, craft.hold, wanted)), sum(craft.hold)),
        "RANGE_LEFT": s.span_of(craft.usable("voyage") - craft.flown, high=4.0),
        "HOME": s.span_of(s.way_home(i)),
        "HOME_COST": s.squash(s.cost(s.way_home(i))) if objective["charge_return"] else 0,
        "CLOCK": s.time_of(craft.clock),
        "AHEAD": s.time_of(craft.clock - s.first_clock()),
        "SPEED": clip(craft.speed / (s.span / s.time), 0, 4),
        "AIR_LEFT": s.air_left(craft),
        "RELOADS": any(row["ALLOWED"] for row in reloads),
        "AFTER_RELOAD": max((row["BEST_THEN"] for row in reloads), default=0),
        "STEPS_LEFT": left / s.steps,
        "ONE_OVER_STEPS": 1 / max(left, 1),
        "LAST_STEP": left <= 1,
        "RETURN_CHARGED": objective["charge_return"],
        "MUST_RETURN": objective["return_to_base"],
        "UAVS_OF_ALL": s.m / (s.m + s.n),
        "ONE_OVER_AREAS": 1 / s.n,
        "COVERED": share(covered, sum(wanted)),
        "SUPPLY_WANTED": share(covered, sum(supply)),
        "DISTANCE_WEIGHT": s.squash(s.cost(s.span)),
        "SWARM_OUT": len(out) / s.m,
        "SWARM_ACTED": sum(each.out and k in s.acted for k, each in enumerate(fleet)) / s.m,
        "DECAY": 0 if half_life is None else flat(s.time / half_life),
        "BONUS": flat((objective.get("minimum_weight") or 1.0) - 1.0) if first else 0,
        "MAKESPAN_WEIGHT": s.squash((objective.get("makespan_weight") or 0.0) * s.time),
        "CHANGE_WEIGHT": s.squash(objective.get("change_weight") or 0.0),
        "HAS_BASES": bool(record is not None and s.d),
    }


def area_row(s: PlainState, j: int) -> dict[str, float]:
    area, need = s.flight.areas[j], sum(s.flight.needs[j])
    nets = sorted((s.net(i, j) for i in range(s.m) if s.possible(i, j)), reverse=True)
    supply = sum(s.possible(i, j).amount for i in range(s.m) if s.possible(i, j))
    level, left = s.worth[j] / s.level, share(need, s.first_needs[j])
    deadline = area.get("deadline")
    others = [k for k in s.near(j) if sum(s.flight.needs[k]) > 0]
    return {
        "NEEDS": need > 0,
        "NEED_LEFT": left,
        "NEED_SHARE": share(need, sum(s.wanted())),
        "LEVEL": level,
        "LEVEL_DECADES": clip(math.log10(level) / 4, -1, 0) if level > 0 else -1,
        "WORTH": level * left,
        "HAS_DEADLINE": deadline is not None,
        "DEADLINE": 4 if deadline is None else s.time_of(deadline - s.first_clock(), low=-1.0),
        "EARLIEST": s.time_of((area.get("earliest") or 0.0) - s.first_clock()),
        "SERVICE": s.time_of(area.get("service_time") or 0.0),
        "ABLE": len(nets) / s.m,
        "SUPPLY": flat(supply / need) if need > 0 else 0,
        "BEST": s.squash(nets[0]) if nets else -1,
        "SECOND": s.squash(nets[1]) if len(nets) > 1 else -1,
        "CHOSEN": j in s.chosen,
        "NEIGHBOUR": s.span_of(s.between(j, others[0], [0])) if others else 10,
    }


def base_row(s: PlainState, d: int) -> dict[str, float]:
    base, wanted = s.flight.bases[d], s.wanted()
    return {
        "STOCK": share(sum(map(min, wanted, s.flight.stocks[d])), sum(wanted)),
        "UNLIMITED": base.get("stock") is None,
        "TURNAROUND": s.time_of(base.get("turnaround") or 0.0),
    }


def visit_row(s: PlainState, i: int, j: int) -> dict[str, float]:
    outcome, craft, area = s.possible(i, j), s.flight.fleet[i], s.flight.areas[j]
    leg = s.flight.legs.leg(craft.record, craft.at, place_of(area))
    distance = 10.0 if leg is None or not craft.out else s.span_of(leg.ground)
    if outcome is None:
        return {"DISTANCE": distance}
    net, cost, then = s.net(i, j), s.cost(leg.ground), outcome.craft
    need, load = sum(s.flight.needs[j]), sum(craft.hold)
    home, home_then = s.flight.way_home(craft, place_of(area)), s.way_home(i, place_of(area))
    rivals = [k for k in range(s.m) if k != i and s.possible(k, j)]
    elsewhere = [s.net(i, k) for k in range(s.n) if k != j and s.possible(i, k)]
    nearest = min(s.possible(i, k).leg.ground for k in range(s.n) if s.possible(i, k))
    after = s.follow_ups(i, j)
    follow_up = max((each for each, _ in after), default=0.0)
    rest = need - outcome.amount
    deadline = area.get("deadline")
    before = [row[i] for row in s.record.get("start_plan") or ()]
    lasts = (then.clock - craft.clock) / s.time
    return {
        "ALLOWED": s.in_order(i, j),
        "DISTANCE": distance,
        "COST": s.squash(cost),
        "VALUE": s.squash(outcome.earned),
        "NET": s.squash(net),
        "SHARE_OF_NEED": share(outcome.amount, need),
        "SHARE_OF_LOAD": share(outcome.amount, load),
        "RANGE_SLACK": s.span_of(then.usable("voyage") - then.flown - home.air, -1.0, 3.0),
        "HOME_THEN": s.span_of(home_then),
        "DETOUR": s.span_of(leg.ground + home_then - s.way_home(i), -10.0),
        "DEADLINE_SLACK": 4 if deadline is None else s.time_of(deadline - outcome.arrival, low=-1.0),
        "FLIGHT_TIME": s.time_of(leg.time),
        "WAIT": s.time_of(outcome.begin - outcome.arrival),
        "AIR_SLACK": s.air_left(then, place_of(area)),
        "FOLLOW_UP": s.squash(follow_up),
        "NET_WITH_FOLLOW_UP": s.squash(net + follow_up),
        "LEAD_OVER_RIVALS": s.squash(net - max([0.0, *(s.net(k, j) for k in rivals)])),
        "LEAD_OVER_ELSEWHERE": s.squash(net - max([0.0, *elsewhere])),
        "SHARE_OF_VALUE": outcome.earned / (outcome.earned + cost) if outcome.earned > 0 else 0,
        "FILLS_NEED": rest <= 1e-9 * need,
        "EMPTIES_LOAD": load - outcome.amount <= 1e-9 * load,
        "REST_BY_RIVALS": share(sum(s.possible(k, j).amount for k in rivals), rest) if rest > 0 else 1,
        "NET_BY_TIME": flat(net / s.level / (0.05 + lasts)),
        "BEFORE": bool(s.objective.get("change_weight")) and j in before and (i, j) not in s.made,
        "AROUND": s.squash(sum(each * math.exp(-8 * way / s.span) for each, way in after)),
        "FARTHER": s.span_of(leg.ground - nearest),
        "CHOSEN": j in s.chosen,
        "MATERIALS": share(
            sum(wants for wants, have in zip(s.flight.needs[j], craft.hold, strict=True) if have > 0), need
        ),
    }


def reload_row(s: PlainState, i: int, d: int) -> dict[str, float]:
    outcome, craft, base = s.possible(i, s.n + 1 + d), s.flight.fleet[i], s.flight.bases[d]
    if outcome is None:
        return {"ALLOWED": 0, "DISTANCE": 10, "BEST_THEN": 0}
    then, leg, wanted = outcome.craft, outcome.leg, s.wanted()
    until, full = craft.record.get("available_until"), sum(craft.full)
    missing = [max(0.0, wants - have) for wants, have in zip(wanted, craft.hold, strict=True)]
    nets, reached = [0.0], 0
    watched = until is not None or craft.record.get("endurance") is not None
    for j in range(s.n):
        after = s.next_visit(then, place_of(base), then.hold, j)
        if after is None:
            continue
        area, (net, _, arrival, home) = s.flight.areas[j], after
        end = max(arrival, area.get("earliest") or 0.0) + (area.get("service_time") or 0.0)
        if watched and until is not None and end + home.time > until:
            continue
        nets.append(net)
        reached += 1
    needy = sum(sum(need) > 0 for need in s.flight.needs)
    now = max([0.0, *(s.net(i, j) for j in range(s.n) if s.possible(i, j))])
    return {
        "ALLOWED": s.in_order(i, s.n + 1 + d),
        "DISTANCE": s.span_of(leg.ground),
        "COST": s.squash(s.cost(leg.ground)),
        "FLIGHT_TIME": s.time_of(leg.time),
        "TURNAROUND": s.time_of(base.get("turnaround") or 0.0),
        "LOADED": share(sum(outcome.loaded), full),
        "LOAD_THEN": share(sum(then.hold), full),
        "LOADED_WANTED": share(sum(map(min, outcome.loaded, missing)), full),
        "BEST_THEN": s.squash(max(nets)),
        "LEAD_OVER_NOW": s.squash(max(nets) - now),
        "REACHED_THEN": reached / needy if needy else 0,
        "RANGE_GAINED": s.span_of(craft.flown, high=4.0),
        "TIME_LEFT": 4 if until is None else s.time_of(until - then.clock, low=-1.0),
        "FARTHER_THAN_HOME": s.span_of(leg.ground - s.way_home(i), -1.0),
    }
