"""Finding source policies in the library: the paper's way, and by what tasks have in common.

Workers live long and answer many requests: a process keeps its library open and its last policies decoded.
"""

from __future__ import annotations

import logging
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from app.domain.errors import (
    AllocatorError,
    InvalidCheckpoint,
    InvalidParameters,
    NoCompatibleSource,
    Violation,
)
from app.domain.problem import Problem
from app.domain.said import Said, said
from app.learning.checkpoints.checkpoint import ANY_SIZE, Network, decode
from app.learning.paper.architecture import QMIX_PAPER_1, QmixConfig
from app.learning.paper.networks import QmixNetwork
from app.library.description import description_space, task_description
from app.library.summary import SUMMARY_SPACE, task_summary
from app.solvers.protocol import SourcePolicy
from app.solvers.registry import unusable_architecture
from policy_store.database import Database
from policy_store.errors import PolicyNotFound, PolicyStoreError
from policy_store.library import PolicyLibrary
from policy_store.policy import Neighbour, Policy
from policy_store.similarity import squared_distances

SHORTLIST = 5
"""Policies for every size that are tried on a problem."""

_LOOKED_THROUGH = 4 * SHORTLIST
"""Nearest policies that the shortlist is made of: several may have the same weights."""

_KEPT = 16
"""Decoded checkpoints a process keeps; a policy for every size takes half a megabyte."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Source:
    """A policy of the library with its networks, which are shared: copy them before training."""

    policy: SourcePolicy
    network: Network


class SourcePolicies:
    """The policies of a library that could be transferred to a problem.

    Parameters
    ----------
    library_url
        The library's database, or None where there is none.
    """

    def __init__(self, library_url: str | None) -> None:
        self._library = None if library_url is None else _open(library_url)

    def most_similar(self, problem: Problem, config: QmixConfig) -> Source:
        """Find the source of the paper (lines 1 to 6 of Algorithm 2), among networks of this shape.

        Raises
        ------
        NoCompatibleSource
            If there is none; ``details["sizes"]`` has the sizes there are.
        """
        library = self._required(problem)
        space, description = description_space(problem), task_description(problem)
        unusable = 0
        for neighbour in _nearest_first(library, space, description, 1, architecture=QMIX_PAPER_1):
            if neighbour.policy.metadata.get("config") == config.as_record():
                if found := _usable(library, neighbour, (QmixNetwork,)):
                    return found[0]
                unusable += 1
        sizes = library.sizes(QMIX_PAPER_1)
        if (problem.n_uavs, problem.n_targets, problem.n_materials) in sizes:
            units = {"agent": config.drqn_hidden_dim, "mixer": config.qmix_hidden_dim}
            if unusable:
                reason = said("none has {agent} and {mixer} hidden units and can be used", **units)
            else:
                reason = said("none has {agent} and {mixer} hidden units", **units)
        elif sizes:
            reason = said("the library has {sizes}", sizes=[f"{m}x{n}x{k}" for m, n, k in sizes])
        else:
            reason = said("the library has none at all")
        raise _no_source(problem, reason, sizes)

    def shortlist(self, problem: Problem) -> list[Source]:
        """Return the policies for every size with the nearest source tasks, nearest first, weights once each.

        One that cannot be used, or was deleted a moment ago, is passed over.

        Raises
        ------
        NoCompatibleSource
            If there is none; ``details["sizes"]`` has the sizes of the other policies.
        """
        library = self._required(problem)
        found: list[Source] = []
        seen: set[str] = set()
        summary = task_summary(problem)
        near = _nearest_first(library, SUMMARY_SPACE, summary, _LOOKED_THROUGH, without=QMIX_PAPER_1)
        for place, neighbour in enumerate(near):
            if place >= _LOOKED_THROUGH and found:
                break
            sha256 = neighbour.policy.checkpoint_sha256
            if sha256 not in seen:
                seen.add(sha256)
                found += _usable(library, neighbour, ANY_SIZE)
            if len(found) == SHORTLIST:
                break
        if not found:
            reason = said("the library has no policy for every size")
            if seen:
                reason = said(
                    "the library has no policy for every size, that can be used; it has {count} that cannot",
                    count=len(seen),
                )
            raise _no_source(problem, reason, library.sizes())
        return found

    def asked_for(self, policy_id: str, problem: Problem, *, config: QmixConfig, any_size: bool) -> Source:
        """Return the policy that a request names.

        Parameters
        ----------
        policy_id
            Its id.
        problem
            The problem it shall be transferred to.
        config
            Shape of the networks of a policy for one size.
        any_size
            Whether a policy for every size may be asked for too, whose distance is that of the summaries, and
            one for this size whatever its hidden units.

        Raises
        ------
        InvalidParameters
            If there is no such policy, or it does not fit or cannot be used.
        NoCompatibleSource
            If there is no library.
        """
        library = self._required(problem)
        try:
            policy, vectors = library.get(policy_id), library.vectors(policy_id)
        except PolicyNotFound:
            raise _bad_source(said("there is no policy {id!r} in the library", id=policy_id)) from None
        if policy.architecture != QMIX_PAPER_1 and SUMMARY_SPACE in vectors:
            if not any_size:
                raise _bad_source(
                    said("policy {id!r} is for every size; paper mode copies one for one size", id=policy_id)
                )
            distance = _distance(vectors[SUMMARY_SPACE], task_summary(problem))
            return _named(library, policy, distance, ANY_SIZE)
        if policy.architecture == unusable_architecture(problem):
            raise _bad_source(
                said(
                    "policy {id!r} ({architecture}) does not observe all that the problem uses; policies for "
                    "every size do",
                    id=policy_id,
                    architecture=policy.architecture,
                )
            )
        space = description_space(problem)
        same = any_size or policy.metadata.get("config") == config.as_record()
        fits = policy.architecture == QMIX_PAPER_1 and _size(policy) == _size(problem) and same
        if not fits or space not in vectors:
            raise _bad_source(
                said(
                    "policy {id!r} ({architecture}, {size}) does not fit a task of {task} with {agent} and "
                    "{mixer} hidden units",
                    id=policy_id,
                    architecture=policy.architecture,
                    size=_size(policy),
                    task=_size(problem),
                    agent=config.drqn_hidden_dim,
                    mixer=config.qmix_hidden_dim,
                )
            )
        return _named(library, policy, _distance(vectors[space], task_description(problem)), (QmixNetwork,))

    def _required(self, problem: Problem) -> PolicyLibrary:
        if self._library is None:
            raise _no_source(problem, said("there is no library"), [])
        return self._library


def preload(library_url: str, problem: Problem) -> None:
    """Open a library and decode its policies for every size, so that no request waits for it.

    As many as a process keeps, with the tasks nearest to a problem; what cannot be used is passed over.
    """
    library = _open(library_url)
    for neighbour in library.nearest(SUMMARY_SPACE, task_summary(problem), _KEPT, without=QMIX_PAPER_1):
        _usable(library, neighbour, ANY_SIZE)


def _nearest_first(
    library: PolicyLibrary,
    space: str,
    description: np.ndarray,
    at_first: int,
    *,
    architecture: str | None = None,
    without: str | None = None,
) -> Iterator[Neighbour]:
    """Go through the policies of an architecture, or without one, nearest first; most callers need few."""
    asked, given = at_first, 0
    while True:
        near = library.nearest(space, description, asked, architecture, without=without)
        yield from near[given:]
        if len(near) < asked:
            return
        given, asked = asked, 8 * asked


def _usable(library: PolicyLibrary, neighbour: Neighbour, kinds: tuple[type[Network], ...]) -> list[Source]:
    """Return a policy with its networks; nothing where it cannot be used."""
    try:
        return [_source(library, neighbour.policy, neighbour.distance, kinds)]
    except (AllocatorError, PolicyStoreError) as error:
        told = {"policy_id": neighbour.policy.id, "reason": str(error)}
        _log.warning("a policy of the library cannot be used", extra=told)
        return []


def _named(
    library: PolicyLibrary, policy: Policy, distance: float, kinds: tuple[type[Network], ...]
) -> Source:
    """Return a policy that a request names.

    Raises
    ------
    InvalidParameters
        If it cannot be used.
    """
    try:
        return _source(library, policy, distance, kinds)
    except (AllocatorError, PolicyStoreError) as error:
        why = error.detail if isinstance(error, AllocatorError) else str(error)
        raise _bad_source(said("policy {id!r} cannot be used: {why}", id=policy.id, why=why)) from error


def _source(
    library: PolicyLibrary, policy: Policy, distance: float, kinds: tuple[type[Network], ...]
) -> Source:
    """Return a policy with its networks.

    Raises
    ------
    InvalidCheckpoint
        If its checkpoint is not what its architecture needs.
    PolicyStoreError
        If the checkpoint is damaged, or was deleted.
    """
    sha256 = policy.checkpoint_sha256
    network = _decoded.get(sha256)
    if network is None:
        network = decode(library.checkpoint(policy.id)).network
        _decoded[sha256] = network
        if len(_decoded) > _KEPT:
            _decoded.popitem(last=False)
    _decoded.move_to_end(sha256)
    if not isinstance(network, kinds):
        raise InvalidCheckpoint(
            said("its networks are not those of architecture {name}", name=policy.architecture)
        )
    return Source(SourcePolicy(policy.id, policy.name, distance), network)


_decoded: OrderedDict[str, Network] = OrderedDict()
"""Networks by the SHA-256 of their checkpoint, the one used last at the end."""


@lru_cache(maxsize=4)
def _open(library_url: str) -> PolicyLibrary:
    return PolicyLibrary(Database(library_url))


def _distance(vector: np.ndarray, query: np.ndarray) -> float:
    return float(squared_distances(vector[None], query.astype(np.float32))[0])


def _size(item: Any) -> str:
    return f"{item.n_uavs}x{item.n_targets}x{item.n_materials}"


def _no_source(problem: Problem, reason: Said, sizes: Sequence[tuple[int, int, int]]) -> NoCompatibleSource:
    return NoCompatibleSource(
        said(
            "no source policy for {size} (UAVs x targets x materials): {why}", size=_size(problem), why=reason
        ),
        details={"sizes": [list(size) for size in sizes]},
    )


def _bad_source(detail: Said) -> InvalidParameters:
    return InvalidParameters(detail, [Violation("/parameters/source", detail)])
