"""Agent networks as ONNX files, for computers on board that have neither torch nor this service.

What is exported is an answer to what is seen: of ``qmix-universal-2`` for all UAVs at once, with the one that
acts first, otherwise a UAV's turn with what it remembers. The mixing network stays behind, since it is
monotonic: the action that is best for the agent's own value is best for the swarm's. What the computer on
board has to feed is written down in ``ON_BOARD.md``.

The packages ``onnx`` and ``onnxscript`` are an extra of the installation and loaded only here.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import logging
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn.attention import SDPBackend, sdpa_kernel

from app.domain.errors import AllocatorError
from app.learning.checkpoints.checkpoint import decode
from app.learning.pairwise.on_board import COLUMNS, PairwiseOnBoard
from app.learning.pairwise.policy import PairwisePolicy
from app.learning.paper.agent_network import AgentNetwork
from app.learning.paper.architecture import QmixConfig
from app.learning.universal.episodes.policy import UniversalPolicy
from app.learning.universal.network.on_board import OWN_NAMES, PAIR_NAMES, RIVAL_NAMES, UniversalOnBoard

OPSET = 20
"""Version of ONNX's operators: the first that has GELU."""

EXTRA = "onnx"
"""The extra of the installation that has what is needed here."""

_NEEDED = ("onnx", "onnxscript")
_KEPT_METADATA = ("architecture", "features", "config", "algorithm", "seed", "version", "name", "families")


class ExtraNotInstalled(AllocatorError):
    """Something was asked for whose packages are an extra that is not installed."""

    code = "extra-not-installed"


class PaperOnBoard(nn.Module):
    """The agent network of the paper (section 2.2) for T agents' turns.

    Parameters
    ----------
    agent
        Its weights are shared, not copied.
    """

    INPUTS = ("observation", "last_action", "uav", "allowed", "hidden")
    OUTPUTS = ("values", "action", "new_hidden")

    def __init__(self, agent: AgentNetwork) -> None:
        super().__init__()
        self.fc1, self.rnn, self.fc2 = agent.fc1, agent.rnn, agent.fc2

    def forward(
        self, observation: Tensor, last_action: Tensor, uav: Tensor, allowed: Tensor, hidden: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Take T turns.

        Parameters
        ----------
        observation
            (T, D) own row and the targets' rows (Eq. 13).
        last_action
            (T, N+1) one-hot; zeros at first.
        uav
            (T, M) one-hot number of the UAV.
        allowed
            (T, N+1) bool.
        hidden
            (T, H) recurrent states of the step before; zeros at first.

        Returns
        -------
        tuple of Tensor
            (T, N+1) Q values, (T,) the best allowed action, (T, H) recurrent states for the next step.
        """
        inputs = torch.relu(self.fc1(torch.cat((observation, last_action, uav), dim=1)))
        rnn = self.rnn
        remembered = torch.gru_cell(inputs, hidden, rnn.weight_ih, rnn.weight_hh, rnn.bias_ih, rnn.bias_hh)
        values = self.fc2(remembered)
        return values, values.masked_fill(~allowed, -torch.inf).argmax(dim=1), remembered

    @staticmethod
    def example(config: QmixConfig) -> tuple[Tensor, ...]:
        """Make inputs to trace with."""
        turns, sizes = 2, config.sizes
        return (
            torch.rand(turns, sizes.own_features + sizes.common_features),
            torch.zeros(turns, sizes.n_actions),
            torch.zeros(turns, sizes.n_agents),
            torch.ones(turns, sizes.n_actions, dtype=torch.bool),
            torch.zeros(turns, config.drqn_hidden_dim),
        )

    @classmethod
    def dynamic_shapes(cls) -> tuple[dict[int, object], ...]:
        """Name the axes whose length is free, by input: turns only, the sizes are the task's."""
        turns = torch.export.Dim("turns")
        return tuple({0: turns} for _ in cls.INPUTS)


def to_onnx(checkpoint: bytes) -> bytes:
    """Write the agent network of a checkpoint as an ONNX model.

    Parameters
    ----------
    checkpoint
        Of any architecture the codec knows.

    Returns
    -------
    bytes
        The model. Its metadata has the SHA-256 of the checkpoint, what that says of itself, and the columns
        of the inputs by name.

    Raises
    ------
    InvalidCheckpoint
        If the checkpoint cannot be read.
    ExtraNotInstalled
        If the packages for it are missing.
    """
    found = decode(checkpoint)
    require_extra()
    onnx = import_module("onnx")
    said = {key: found.metadata[key] for key in _KEPT_METADATA if key in found.metadata}
    properties = {"sha256": hashlib.sha256(checkpoint).hexdigest(), "checkpoint": _json(said)}
    columns: dict[str, Sequence[str]] = {}
    module: PairwiseOnBoard | UniversalOnBoard | PaperOnBoard
    if isinstance(found.network, PairwisePolicy):
        module, example = PairwiseOnBoard(found.network.agent), PairwiseOnBoard.example()
        columns = {name: [each.name.lower() for each in kind] for name, kind in COLUMNS.items()}
    elif isinstance(found.network, UniversalPolicy):
        module = UniversalOnBoard(found.network.agent)
        example = UniversalOnBoard.example(found.network.config)
        columns = {"pair": PAIR_NAMES, "own": OWN_NAMES, "rivals": RIVAL_NAMES}
    else:
        assert isinstance(found.config, QmixConfig)
        module, example = PaperOnBoard(found.network.agent), PaperOnBoard.example(found.config)
    model = _trace(module, example)
    if columns:
        properties["columns"] = _json(columns)
    onnx.helper.set_model_props(model, properties)
    onnx.checker.check_model(model, full_check=True)
    data: bytes = model.SerializeToString(deterministic=True)
    return data


def require_extra() -> None:
    """Make sure that the packages of the extra are there.

    Raises
    ------
    ExtraNotInstalled
        If one of them is not; the message says how to get them.
    """
    for name in _NEEDED:
        try:
            import_module(name)
        except ImportError:
            raise ExtraNotInstalled(
                f"writing ONNX needs the package {name}, which is not installed; "
                f"the extra has it: pip install 'uav-allocator[{EXTRA}]'"
            ) from None


def _trace(module: PairwiseOnBoard | UniversalOnBoard | PaperOnBoard, example: tuple[Tensor, ...]) -> Any:
    """Trace a module and return the model, without what the tracer tells about this machine."""
    # Of the kernels for attention only the plain one is made of operators that ONNX has.
    with _quiet(), sdpa_kernel(SDPBackend.MATH), torch.random.fork_rng(devices=[]):
        program = torch.onnx.export(
            module.eval(),
            example,
            dynamo=True,
            opset_version=OPSET,
            input_names=module.INPUTS,
            output_names=module.OUTPUTS,
            dynamic_shapes=module.dynamic_shapes(),
            verbose=False,
        )
    assert program is not None
    model = program.model_proto
    model.producer_name = "uav-allocator"
    model.doc_string = inspect.getdoc(module.forward) or ""
    graph = model.graph
    graph.name = "turn"
    for item in (
        model,
        graph,
        *graph.node,
        *graph.input,
        *graph.output,
        *graph.value_info,
        *graph.initializer,
    ):
        del item.metadata_props[:]
    return model


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep the tracer from talking: what it has to say is about its own insides."""
    tracer = logging.getLogger("torch.onnx")
    level = tracer.level
    tracer.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        tracer.setLevel(level)


def _json(value: object) -> str:
    return json.dumps(value, sort_keys=True, ensure_ascii=False)
