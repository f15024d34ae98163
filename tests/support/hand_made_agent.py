"""An agent of ``qmix-universal-2`` whose values are known: the net of a visit, the best after a reload."""

import torch

from app.learning.pairwise.agent import PairwiseAgent
from app.learning.pairwise.architecture import HEADS, PairwiseConfig
from app.learning.pairwise.features import ReloadFeature, VisitFeature

HOME = -0.02
"""Value of "return"."""

SHARPNESS = 3.0
"""Log-odds are values times so much."""

_HIGH = 20.0
"""Where GELU changes nothing."""


def by_net() -> PairwiseAgent:
    """Return an agent to which a visit is worth its ``NET`` and a reload half its ``BEST_THEN``."""
    agent = PairwiseAgent(PairwiseConfig(width=HEADS, layers=1))
    with torch.no_grad():
        for parameter in agent.parameters():
            parameter.zero_()
        for inner, head, feature, worth in (
            (agent.visit_in, agent.visit_head, VisitFeature.NET, 1.0),
            (agent.reload_in, agent.reload_head, ReloadFeature.BEST_THEN, 0.5),
        ):
            # ReLU takes a number from the half of the positive, so 1 is added before and taken away after.
            inner.weight[0, feature], inner.bias[0] = worth, 1.0
            head.weight[0, 0] = 1.0
        agent.uav_head.bias[0] = _HIGH - 1.0
        agent.home_head.bias[0] = _HIGH + HOME
        agent.score.weight[0, 0], agent.score.bias[0] = 1.0, -_HIGH
        agent.sharpness.fill_(torch.tensor(SHARPNESS).log())
    return agent
