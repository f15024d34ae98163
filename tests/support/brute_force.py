"""The best plan of a tiny problem, by trying every legal sequence of actions; shares no code with solvers."""

from referee import Illegal, replay


def best_reward(problem: dict) -> float:
    """Largest reward of any legal plan.

    Actions are tried in the order in which they are taken, and every prefix is judged by the referee: this is
    exponential, for a few UAVs, targets and steps.
    """
    m, n, steps = len(problem["uavs"]), len(problem["targets"]), problem["max_steps"]
    best = replay(problem, [[n] * m])["reward"]
    prefixes = [[]]
    for place in range(m * steps):
        prefixes, shorter = [], prefixes
        for prefix in shorter:
            at_home = n in prefix[place % m :: m]
            for action in [n] if at_home else range(n + 1):
                actions = [*prefix, action]
                padded = actions + [n] * (-len(actions) % m)
                rows = [padded[r : r + m] for r in range(0, len(padded), m)]
                try:
                    best = max(best, replay(problem, rows)["reward"])
                except Illegal:
                    continue
                prefixes.append(actions)
    return best
