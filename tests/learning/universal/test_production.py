"""From nothing to the file of a policy, and again without doing anything twice."""

import torch

from app.learning.checkpoint import decode
from app.learning.universal.production import UniversalTrainingParameters, train_universal

PARAMETERS = UniversalTrainingParameters(shards=1, updates=2, width=8, layers=1, metric_problems=1)


def test_a_second_run_finds_everything_done(tmp_path):
    told, threads = [], torch.get_num_threads()
    file, work = tmp_path / "library" / "policy.safetensors", tmp_path / "work"
    train_universal(file, work, PARAMETERS, 1, lambda stage, share, said: told.append((stage, share)))
    first = file.read_bytes()
    changed = {path.name: path.stat().st_mtime_ns for path in work.iterdir()}

    train_universal(file, work, PARAMETERS, 1, lambda stage, share, said: None)

    assert file.read_bytes() == first
    assert {path.name: path.stat().st_mtime_ns for path in work.iterdir()} == changed
    assert torch.get_num_threads() == threads
    assert [stage for stage, share in told if share == 1.0] == ["demonstrations", "training", "metrics"]
    metadata = decode(first).metadata
    ratios = [value for name, value in metadata["metrics"].items() if name.startswith("greedy_ratio")]
    assert len(ratios) == len(metadata["families"])
    assert all(ratio < 1.1 for ratio in ratios)
