"""What the universal policy learns from: demonstrations, and the rewards of whole episodes.

Two losses are added. Cross-entropy on demonstrations makes the demonstrated action the most likely one.
The loss of QMIX, squared TD errors of Q_tot against TD(lambda) targets of a slowly following copy with
double-Q, ties the values to what episodes earn; it also learns from the policy's own episodes.
"""

from __future__ import annotations

import copy
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from app.learning.parameters import SERVICE_GRAD_NORM_CLIP
from app.learning.universal.episodes.observation import nearness, scales
from app.learning.universal.episodes.turns import Turns
from app.learning.universal.network.agent import UniversalAgent
from app.learning.universal.network.mixer import UniversalMixer
from app.learning.universal.updates.optimiser import MakeOptimisers, adam
from app.learning.universal.updates.returns import lambda_returns
from app.simulation.arrays import ProblemArrays
from app.solvers.protocol import StopCriterion
from app.solvers.stop import never


class Batch(NamedTuple):
    """T turns of B episodes as tensors.

    Attributes
    ----------
    pair, own, rivals
        (T, N, F), (T, G) and (T, N, M, R) observations.
    action
        (T,) what was done.
    episode, step, uav
        (T,) where each turn belongs.
    distance
        (B, N, N) scaled distances between targets.
    reward
        (B, S) rewards of the steps, in largest levels and a UAV.
    sizes
        B, S and M.
    """

    pair: Tensor
    own: Tensor
    rivals: Tensor
    action: Tensor
    episode: Tensor
    step: Tensor
    uav: Tensor
    distance: Tensor
    reward: Tensor
    sizes: tuple[int, int, int]


def make_batch(arrays: ProblemArrays, turns: Turns, device: torch.device) -> Batch:
    """Turn unfolded episodes, one of each problem of a stack in order, into tensors."""
    span, level, _ = scales(arrays)
    m = arrays.shape[0]
    distance = nearness(arrays, span)
    reward = (turns.reward / level[:, None] / m).astype(np.float32)
    columns = {**turns._asdict(), "distance": distance, "reward": reward}
    tensors = {name: torch.from_numpy(column).to(device) for name, column in columns.items()}
    return Batch(**tensors, sizes=(*reward.shape, m))


class Values(NamedTuple):
    """What the agent makes of a batch.

    Attributes
    ----------
    values
        (T, N+1) Q values of every action, allowed or not.
    allowed
        (T, N+1)
    hidden
        (B, S, M, W) recurrent states; 0 where a UAV has returned.
    """

    values: Tensor
    allowed: Tensor
    hidden: Tensor


def evaluate(agent: UniversalAgent, batch: Batch) -> Values:
    """Run the agent over whole episodes."""
    b, s, m = batch.sizes
    bias = agent.bias(batch.distance)[batch.episode]
    tokens = agent.encode(batch.pair, batch.own, batch.rivals, bias)
    place = (batch.step, batch.episode * m + batch.uav)
    seen = tokens.new_zeros(s, b * m, tokens.shape[-1]).index_put(place, tokens.mean(dim=1))
    remembered, _ = agent.memory(seen)
    hidden = remembered[place]
    allowed = functional.pad(batch.pair[:, :, 0] > 0, (0, 1), value=True)
    shaped = remembered.new_zeros(s, b * m, tokens.shape[-1]).index_put(place, hidden)
    return Values(agent.values(tokens, hidden), allowed, shaped.view(s, b, m, -1).transpose(0, 1))


class Learner:
    """Fits an agent and a mixer.

    Parameters
    ----------
    agent, mixer
        Trained in place.
    lr
        Learning rate at its highest; see :meth:`update`.
    td_weight
        Weight of the TD loss beside the cross-entropy.
    gamma, td_lambda
        Discount and trace of the TD targets.
    polyak
        Share by which the target networks follow at every update.
    optimisers
        Makes what steps the weights.
    """

    def __init__(
        self,
        agent: UniversalAgent,
        mixer: UniversalMixer,
        *,
        lr: float,
        td_weight: float,
        gamma: float = 0.99,
        td_lambda: float = 0.8,
        polyak: float = 0.01,
        optimisers: MakeOptimisers = adam,
    ) -> None:
        self.agent, self.mixer = agent, mixer
        self.target_agent, self.target_mixer = copy.deepcopy(agent), copy.deepcopy(mixer)
        self._lr, self._td_weight = lr, td_weight
        self._gamma, self._td_lambda, self._polyak = gamma, td_lambda, polyak
        self._trained = nn.ModuleList((agent, mixer))
        self._targets = nn.ModuleList((self.target_agent, self.target_mixer))
        self._targets.requires_grad_(False)
        self.networks = nn.ModuleList((self._trained, self._targets))
        self.optimisers = optimisers(self._trained, lr)

    def update(
        self,
        batch: Batch,
        share_of_lr: float,
        *,
        imitate: bool,
        bootstrap: bool,
        stop: StopCriterion = never,
    ) -> dict[str, float]:
        """Take one step, and return the losses by name: ``imitation``, ``td``.

        Parameters
        ----------
        batch
            Episodes.
        share_of_lr
            Of the learning rate.
        imitate
            Whether the actions are worth imitating: adds the cross-entropy.
        bootstrap
            Adds the TD loss; at least one of the two.
        stop
            Asked between the parts. Where it is true nothing has changed, and there are no losses.
        """
        for optimiser in self.optimisers:
            for group in optimiser.param_groups:
                group["lr"] = self._lr * share_of_lr
        online = evaluate(self.agent, batch)
        if stop():
            return {}
        losses = {}
        if imitate:
            logits = self.agent.logits(online.values).masked_fill(~online.allowed, -1e9)
            losses["imitation"] = functional.cross_entropy(logits, batch.action)
        if bootstrap:
            losses["td"] = self._td_weight * self._td_loss(batch, online)
            if stop():
                return {}
        self._trained.zero_grad(set_to_none=True)
        torch.stack(list(losses.values())).sum().backward()  # type: ignore[no-untyped-call]  # untyped in torch
        if stop():
            return {}
        nn.utils.clip_grad_norm_(self._trained.parameters(), SERVICE_GRAD_NORM_CLIP)
        for optimiser in self.optimisers:
            optimiser.step()
        with torch.no_grad():
            for slow, fast in zip(self._targets.parameters(), self._trained.parameters(), strict=True):
                slow.lerp_(fast, self._polyak)
        return {name: loss.item() for name, loss in losses.items()}

    def _td_loss(self, batch: Batch, online: Values) -> Tensor:
        chosen = online.values.gather(1, batch.action[:, None])[:, 0]
        joint, running = joint_values(batch, chosen, online.hidden, self.mixer)
        with torch.no_grad():
            best = online.values.masked_fill(~online.allowed, -torch.inf).argmax(dim=1, keepdim=True)
            slow = evaluate(self.target_agent, batch)
            following, _ = joint_values(
                batch, slow.values.gather(1, best)[:, 0], slow.hidden, self.target_mixer
            )
            target = lambda_returns(batch.reward, following, running, self._gamma, self._td_lambda)
        error = (joint - target).square() * running
        return error.sum() / running.sum().clamp(min=1.0)


def joint_values(
    batch: Batch, chosen: Tensor, hidden: Tensor, mixer: UniversalMixer
) -> tuple[Tensor, Tensor]:
    """Q_tot (B, S) of chosen values (T,), and which steps (B, S) belong to their episodes, 0 or 1."""
    b, s, m = batch.sizes
    place = (batch.episode, batch.step, batch.uav)
    values = chosen.new_zeros(b, s, m).index_put(place, chosen)
    present = torch.zeros(b, s, m, dtype=torch.bool, device=chosen.device)
    present[place] = True
    joint = mixer(values.view(b * s, m), hidden.reshape(b * s, m, -1), present.view(b * s, m))
    return joint.view(b, s), present.any(dim=2).to(chosen.dtype)
