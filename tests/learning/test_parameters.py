import subprocess
import sys

import pytest
from pydantic import ValidationError

from app.domain.errors import InvalidParameters
from app.learning.parameters import (
    DqnParameters,
    QmixParameters,
    TableParameters,
    TransferQmixParameters,
)
from app.solvers.registry import parse_parameters

TABLE_1 = {
    "n_epochs": 50_000,
    "evaluate_per_epoch": 100,
    "batch_size": 32,
    "buffer_size": 100,
    "update_target_params": 200,
    "drqn_hidden_dim": 64,
    "qmix_hidden_dim": 32,
}
TABLE_3 = {**TABLE_1, "n_epochs": 200, "evaluate_per_epoch": 1}


@pytest.mark.parametrize(
    ("name", "table", "epsilon_start"), [("qmix", TABLE_1, 1.0), ("transfer_qmix", TABLE_3, 0.05)]
)
def test_defaults_are_the_papers_tables(name, table, epsilon_start):
    parameters = parse_parameters(name, {"mode": "paper"})
    assert parameters.mode == "paper"
    filled = parameters.model_dump(exclude={"n_epochs"})
    parameters = parameters.table().model_dump()
    assert filled.items() >= parameters.items() - {("n_epochs", table["n_epochs"])}
    assert {key: parameters[key] for key in table} == table
    assert parameters["epsilon_start"] == epsilon_start
    assert (parameters["lr"], parameters["gamma"], parameters["grad_norm_clip"]) == (5e-4, 0.99, 10.0)
    assert (parameters["epsilon_end"], parameters["epsilon_anneal_steps"]) == (0.05, 50_000)


@pytest.mark.parametrize("name", ["qmix", "transfer_qmix"])
def test_service_mode_is_the_default(name):
    assert parse_parameters(name, {}).mode == "service"


@pytest.mark.parametrize("given", [{"samples": 4}, {"replans": 4}, {"polish": False}, {"polish_moves": 10}])
def test_paper_mode_has_no_search(given):
    assert TransferQmixParameters(**given).mode == "service"
    with pytest.raises(ValidationError, match=f"{next(iter(given))} belongs to service mode"):
        TransferQmixParameters(mode="paper", **given)


PAPER_ONLY = {
    "buffer_size": 7,
    "update_target_params": 3,
    "lr": 0.9,
    "grad_norm_clip": 1e-3,
    "epsilon_start": 0.0,
    "epsilon_end": 0.9,
    "epsilon_anneal_steps": 5,
    "learning_starts": 5,
}
USELESS = [
    *[("qmix", "service", name, value) for name, value in PAPER_ONLY.items()],
    *[("transfer_qmix", "service", name, value) for name, value in PAPER_ONLY.items()],
    *[("transfer_qmix", "service", f"{part}_hidden_dim", 64) for part in ("drqn", "qmix")],
    *[("transfer_qmix", "paper", name, 1) for name in ("orders", "samples", "replans", "polish_moves")],
    ("transfer_qmix", "paper", "polish", True),
]


@pytest.mark.parametrize(("algorithm", "mode", "name", "value"), USELESS)
def test_what_a_mode_has_no_use_for_is_refused_by_name(algorithm, mode, name, value):
    other = {"service": "paper", "paper": "service"}[mode]
    assert getattr(parse_parameters(algorithm, {"mode": other, name: value}), name) == value
    assert parse_parameters(algorithm, {"mode": mode, name: None}).mode == mode
    with pytest.raises(InvalidParameters) as refused:
        parse_parameters(algorithm, {"mode": mode, name: value})
    (violation,) = refused.value.violations
    assert violation.pointer == f"/parameters/{name}"
    assert f"{name} belongs to {other} mode" in violation.detail
    assert repr(value) in violation.detail


def test_everything_that_a_mode_has_no_use_for_is_listed():
    with pytest.raises(InvalidParameters) as refused:
        parse_parameters("qmix", {**PAPER_ONLY, "batch_size": 0})
    pointers = {violation.pointer for violation in refused.value.violations}
    assert pointers == {f"/parameters/{name}" for name in (*PAPER_ONLY, "batch_size")}


@pytest.mark.parametrize(("model", "lr"), [(QmixParameters, 1e-3), (TransferQmixParameters, 1e-4)])
def test_what_service_mode_always_has_may_be_asked_for(model, lr):
    used = model().in_service().model_dump(mode="json")
    assert (used["lr"], used["grad_norm_clip"], used["epsilon_end"]) == (lr, 1.0, 0.2)
    assert model(**used).model_dump(mode="json") == used


def test_parameters_that_an_earlier_version_stored_are_read():
    """It stored the default of every parameter, whatever the mode."""
    stored = {**TableParameters().model_dump(mode="json"), "mode": "service", "n_epochs": 8}
    assert parse_parameters("qmix", stored, stored=True) == QmixParameters(n_epochs=8)
    with pytest.raises(InvalidParameters):
        parse_parameters("qmix", stored)
    paper = {**stored, "mode": "paper", "lr": 0.5}
    assert parse_parameters("qmix", paper, stored=True).table().lr == 0.5


def test_the_schema_says_which_modes_use_a_parameter():
    fields = TransferQmixParameters.model_json_schema()["properties"]
    assert fields["lr"]["modes"] == fields["qmix_hidden_dim"]["modes"] == ["paper"]
    assert fields["orders"]["modes"] == fields["polish"]["modes"] == ["service"]
    assert "modes" not in fields["n_epochs"]
    assert "modes" not in QmixParameters.model_json_schema()["properties"]["qmix_hidden_dim"]


def test_filled_in_parameters_are_parameters_again():
    for mode in ("paper", "service"):
        dumped = TransferQmixParameters(mode=mode).model_dump(mode="json")
        assert TransferQmixParameters(**dumped).model_dump(mode="json") == dumped


def test_first_update_waits_for_a_full_buffer_by_default():
    assert TableParameters().first_update == 100
    assert TableParameters(buffer_size=10).first_update == 10
    assert TableParameters(learning_starts=7).first_update == 7
    assert TableParameters(learning_starts=70, buffer_size=10).first_update == 10


@pytest.mark.parametrize(
    "given",
    [
        {"n_epochs": -1},
        {"batch_size": 0},
        {"epsilon_start": 1.5},
        {"mode": "fast"},
        {"n_epoch": 1},
        {"lr": 0},
    ],
)
def test_what_is_out_of_range_or_unknown_is_refused(given):
    for model in (QmixParameters, TransferQmixParameters):
        with pytest.raises(ValidationError):
            model(**given)


def test_every_parameter_is_described():
    for model in (QmixParameters, TransferQmixParameters, DqnParameters):
        assert all(field.description for field in model.model_fields.values())


@pytest.mark.parametrize(
    "module", ["app.learning", "app.learning.parameters", "app.learning.paper.architecture"]
)
def test_is_imported_without_torch_and_compiled_code(module):
    code = f"import sys, {module}; sys.exit(any(name in sys.modules for name in ('torch', 'numba')))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
