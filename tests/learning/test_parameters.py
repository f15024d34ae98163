import subprocess
import sys

import pytest
from pydantic import ValidationError

from app.learning.parameters import DqnParameters, QmixParameters, TransferQmixParameters
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
    if name == "transfer_qmix":
        parameters = parameters.table_3()
    parameters = parameters.model_dump()
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


def test_filled_in_parameters_are_parameters_again():
    for mode in ("paper", "service"):
        dumped = TransferQmixParameters(mode=mode).model_dump(mode="json")
        assert TransferQmixParameters(**dumped).model_dump(mode="json") == dumped


def test_first_update_waits_for_a_full_buffer_by_default():
    assert QmixParameters().first_update == 100
    assert QmixParameters(buffer_size=10).first_update == 10
    assert QmixParameters(learning_starts=7).first_update == 7
    assert QmixParameters(learning_starts=70, buffer_size=10).first_update == 10


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


@pytest.mark.parametrize("module", ["app.learning", "app.learning.parameters", "app.learning.architecture"])
def test_is_imported_without_torch_and_compiled_code(module):
    code = f"import sys, {module}; sys.exit(any(name in sys.modules for name in ('torch', 'numba')))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
