"""From nothing to the files of all policies, and again without doing anything twice."""

from dataclasses import replace

import torch

from app.learning.checkpoints.checkpoint import decode
from app.learning.universal.training import production
from app.learning.universal.training.production import Production, UniversalTrainingParameters
from app.simulation.generator import FAMILIES

PARAMETERS = UniversalTrainingParameters(
    shards=1,
    updates=2,
    family_shards=1,
    family_updates=1,
    width=8,
    layers=1,
    metric_problems=1,
    search=0.01,
)
SOME = {name: FAMILIES[name] for name in ("single_base", "mid_mission")}


def test_a_second_run_finds_everything_done(tmp_path, monkeypatch):
    monkeypatch.setattr(production, "FAMILIES", SOME)
    told, threads = [], torch.get_num_threads()
    folder, work = tmp_path / "library", tmp_path / "work"
    making = Production(work, PARAMETERS, 2, lambda stage, share, said: told.append((stage, share)))
    files = making.run(folder, "all")
    first = [file.read_bytes() for file in files]
    changed = {path.name: path.stat().st_mtime_ns for path in work.iterdir()}

    assert replace(making, workers=1).run(folder, "all") == files

    assert [file.read_bytes() for file in files] == first
    assert {path.name: path.stat().st_mtime_ns for path in work.iterdir()} == changed
    assert torch.get_num_threads() == threads
    stages = [stage for stage, share in told if share == 1.0]
    assert stages[:5] == ["demonstrations", "general", "families", "fresh problems", "metrics"]
    assert [file.stem for file in files] == [
        "all",
        *(f"all-{family.replace('_', '-')}" for family in SOME),
    ]
    weights = set()
    for file, families in zip(files, [list(SOME), *([family] for family in SOME)], strict=True):
        checkpoint = decode(file.read_bytes())
        assert checkpoint.metadata["families"] == families
        ratios = [
            value for name, value in checkpoint.metadata["metrics"].items() if name.startswith("greedy_ratio")
        ]
        assert len(ratios) == len(SOME)
        assert all(ratio < 1.1 for ratio in ratios)
        weights.add(b"".join(tensor.numpy().tobytes() for tensor in checkpoint.network.state_dict().values()))
    assert len(weights) == len(files)
