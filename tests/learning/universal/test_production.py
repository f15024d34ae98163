"""From nothing to the policy's file, and again without doing anything twice."""

import shutil

import torch

from app.learning.checkpoints.checkpoint import decode
from app.learning.universal.training import production
from app.learning.universal.training.production import Production, UniversalTrainingParameters
from app.simulation.generator import FAMILIES

PARAMETERS = UniversalTrainingParameters(
    plans=2,
    rounds=1,
    corrections=1,
    size=2,
    first_updates=3,
    round_updates=2,
    width=8,
    layers=1,
    metric_problems=1,
    search=0.01,
)
SOME = {name: FAMILIES[name] for name in ("single_base", "mid_mission")}


def written(folder):
    return {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}


def test_a_run_that_was_interrupted_goes_on_and_ends_with_the_same_file(tmp_path, monkeypatch):
    monkeypatch.setattr(production, "FAMILIES", SOME)
    told, threads = [], torch.get_num_threads()
    folder, work = tmp_path / "library", tmp_path / "work"
    making = Production(work, PARAMETERS, 1, lambda stage, share, said: told.append((stage, share)))
    file = making.run(folder, "mine")
    first, there = file.read_bytes(), written(work)
    assert file == folder / "mine.safetensors"
    assert torch.get_num_threads() == threads
    stages = ["plans", "fit 0", "corrections 1", "fit 1", "fresh problems", "metrics"]
    assert [stage for stage, share in told if share == 1.0] == stages

    # As after a power failure in the first fit.
    left = tmp_path / "left"
    shutil.copytree(work, left)
    kept = {name for name in there if name.startswith("plans")}
    for path in left.iterdir():
        if path.name not in kept:
            path.unlink()
    before = written(left)
    again = Production(left, PARAMETERS, 1, lambda *_said: None).run(tmp_path / "again", "mine")
    assert again.read_bytes() == first
    assert {name: written(left)[name] for name in kept} == before
    assert set(written(left)) == set(there)

    checkpoint = decode(first)
    assert checkpoint.metadata["families"] == list(SOME)
    assert checkpoint.metadata["parameters"] == PARAMETERS.model_dump(mode="json")
    ratios = {
        name.removeprefix("greedy_ratio_"): value for name, value in checkpoint.metadata["metrics"].items()
    }
    assert list(ratios) == sorted([*SOME, "drawn"])
    assert all(0.0 <= ratio < 1.1 for ratio in ratios.values())
