"""What the policy learns from: what was done in states, and the rewards of whole episodes.

Two losses are added. Cross-entropy makes what was done the most likely action of every UAV in a state. The
loss of QMIX, squared TD errors of Q_tot against TD(lambda) targets of a slowly following copy with double-Q,
ties the values to what episodes earn.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from app.learning.pairwise.agent import PairwiseAgent, Sight
from app.learning.pairwise.seen import Seen
from app.learning.pairwise.states import UNKNOWN, States, Turns
from app.learning.parameters import SERVICE_GRAD_NORM_CLIP
from app.learning.universal.network.mixer import UniversalMixer
from app.learning.universal.updates.optimiser import MakeOptimisers, adam
from app.learning.universal.updates.returns import lambda_returns
from app.solvers.protocol import StopCriterion
from app.solvers.stop import never


class Batch(NamedTuple):
    """T states as tensors.

    Attributes
    ----------
    sight
        What is seen of them.
    action
        (T, M) what each UAV did, or ``UNKNOWN``.
    """

    sight: Sight
    action: Tensor


class Decisions(NamedTuple):
    """Whole episodes as tensors: in each of T states one UAV acts.

    Attributes
    ----------
    batch
        The states.
    episode, step, uav
        (T,) where each belongs, and who acts.
    reward
        (B, S) rewards of the steps, as :class:`~app.learning.pairwise.states.Turns` has them.
    """

    batch: Batch
    episode: Tensor
    step: Tensor
    uav: Tensor
    reward: Tensor


def make_batch(parts: Sequence[States], device: torch.device) -> Batch:
    """Turn states of some problems, whose sizes may differ, into tensors."""
    sizes = [
        (*part.seen.uavs.shape[:2], part.seen.areas.shape[1], part.seen.bases.shape[1]) for part in parts
    ]
    total = sum(size[0] for size in sizes)
    m, n, d = (max(size[axis] for size in sizes) for axis in (1, 2, 3))
    seen = Seen(
        *(
            np.zeros((total, *shape, part.shape[-1]), np.float32)
            for part, shape in zip(parts[0].seen, ((m,), (n,), (d,), (m, n), (m, d)), strict=True)
        )
    )
    distance = np.zeros((total, n + d, n + d), np.float32)
    present = np.zeros((total, m + n + d), np.bool_)
    action = np.full((total, m), UNKNOWN, np.int64)
    begin = 0
    for part, (count, uavs, areas, bases) in zip(parts, sizes, strict=True):
        rows = slice(begin, begin + count)
        for whole, own in zip(seen, part.seen, strict=True):
            whole[(rows, *(slice(length) for length in own.shape[1:-1]))] = own
        places = np.r_[0:areas, n : n + bases]
        distance[rows][:, places[:, None], places] = part.distance
        present[rows, :uavs] = present[rows, m : m + areas] = present[rows, m + n : m + n + bases] = True
        # "Return" comes after all areas, and bases after it.
        action[rows, :uavs] = np.where(part.action >= areas, part.action - areas + n, part.action)
        begin += count
    tensors = (torch.from_numpy(each).to(device) for each in (*seen, distance, present))
    return Batch(Sight(*tensors), torch.from_numpy(action).to(device))


def make_decisions(parts: Sequence[Turns], device: torch.device) -> Decisions:
    """Turn whole episodes of some problems, whose sizes may differ, into tensors."""
    steps = max(len(part.reward) for part in parts)
    reward = np.zeros((len(parts), steps), np.float32)
    for row, part in zip(reward, parts, strict=True):
        row[: len(part.reward)] = part.reward
    episode = np.repeat(np.arange(len(parts)), [len(part.step) for part in parts])
    step, uav = np.concatenate([part.step for part in parts]), np.concatenate([part.uav for part in parts])
    columns = (torch.from_numpy(each).to(device) for each in (episode, step, uav, reward))
    return Decisions(make_batch([part.states for part in parts], device), *columns)


def allowed(sight: Sight) -> Tensor:
    """Which actions (T, M, N+1+D) are allowed; "return" always is."""
    home = torch.ones_like(sight.uavs[..., :1], dtype=torch.bool)
    return torch.cat((sight.visits[..., 0] > 0, home, sight.reloads[..., 0] > 0), dim=2)


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
        Share by which the target networks follow whenever the TD loss is learned.
    optimisers
        Makes what steps the weights.
    """

    def __init__(
        self,
        agent: PairwiseAgent,
        mixer: UniversalMixer,
        *,
        lr: float,
        td_weight: float,
        gamma: float = 0.99,
        td_lambda: float = 0.8,
        polyak: float = 0.04,
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
        share_of_lr: float,
        batch: Batch | None = None,
        decisions: Decisions | None = None,
        stop: StopCriterion = never,
    ) -> dict[str, float]:
        """Take one step, and return the losses by name: ``imitation``, ``td``.

        Parameters
        ----------
        share_of_lr
            Of the learning rate.
        batch
            States whose actions are worth imitating: adds the cross-entropy.
        decisions
            Whole episodes: adds the TD loss. At least one of the two is given.
        stop
            Asked between the parts. Where it is true nothing has changed, and there are no losses.
        """
        for optimiser in self.optimisers:
            for group in optimiser.param_groups:
                group["lr"] = self._lr * share_of_lr
        losses = {}
        if batch is not None:
            values, _ = self.agent(batch.sight)
            logits = self.agent.logits(values).masked_fill(~allowed(batch.sight), -1e9)
            known = batch.action != UNKNOWN
            losses["imitation"] = functional.cross_entropy(logits[known], batch.action[known])
            if stop():
                return {}
        if decisions is not None:
            losses["td"] = self._td_weight * self._td_loss(decisions)
            if stop():
                return {}
        self._trained.zero_grad(set_to_none=True)
        torch.stack(list(losses.values())).sum().backward()  # type: ignore[no-untyped-call]  # untyped in torch
        if stop():
            return {}
        nn.utils.clip_grad_norm_(self._trained.parameters(), SERVICE_GRAD_NORM_CLIP)
        for optimiser in self.optimisers:
            optimiser.step()
        if decisions is not None:
            with torch.no_grad():
                for slow, fast in zip(self._targets.parameters(), self._trained.parameters(), strict=True):
                    slow.lerp_(fast, self._polyak)
        return {name: loss.item() for name, loss in losses.items()}

    def _td_loss(self, decisions: Decisions) -> Tensor:
        sight, rows = decisions.batch.sight, torch.arange(len(decisions.uav))
        acting = (rows, decisions.uav)
        values, hidden = self.agent(sight)
        mine = values[acting]
        chosen = mine.gather(1, decisions.batch.action[acting][:, None])[:, 0]
        joint, running = joint_values(decisions, chosen, hidden[acting], self.mixer)
        with torch.no_grad():
            best = mine.masked_fill(~allowed(sight)[acting], -torch.inf).argmax(dim=1, keepdim=True)
            slow, seen = self.target_agent(sight)
            following, _ = joint_values(
                decisions, slow[acting].gather(1, best)[:, 0], seen[acting], self.target_mixer
            )
            target = lambda_returns(decisions.reward, following, running, self._gamma, self._td_lambda)
        error = (joint - target).square() * running
        return error.sum() / running.sum().clamp(min=1.0)


def joint_values(
    decisions: Decisions, chosen: Tensor, hidden: Tensor, mixer: UniversalMixer
) -> tuple[Tensor, Tensor]:
    """Q_tot (B, S) of chosen values (T,), and which steps (B, S) belong to their episodes, 0 or 1.

    `hidden` is what stands for the UAVs' states, (T, W).
    """
    b, s = decisions.reward.shape
    m = decisions.batch.sight.uavs.shape[1]
    place = (decisions.episode, decisions.step, decisions.uav)
    values = chosen.new_zeros(b, s, m).index_put(place, chosen)
    states = hidden.new_zeros(b, s, m, hidden.shape[-1]).index_put(place, hidden)
    present = torch.zeros(b, s, m, dtype=torch.bool, device=chosen.device)
    present[place] = True
    joint = mixer(values.view(b * s, m), states.view(b * s, m, -1), present.view(b * s, m))
    return joint.view(b, s), present.any(dim=2).to(chosen.dtype)
