from dataclasses import replace

from app.domain.records import problem_from_record
from app.learning.checkpoints.checkpoint import decode, verify
from app.learning.train_library import (
    PAPER_SHAPES,
    example_shapes,
    source_parameters,
    source_tasks,
    train_library,
)
from app.library.entries import new_policy


def test_source_tasks_cover_the_papers_sizes_and_the_examples():
    tasks = source_tasks()
    shapes = {(t.problem.n_uavs, t.problem.n_targets, t.problem.n_materials) for t in tasks}
    assert shapes == {*PAPER_SHAPES, *example_shapes()}
    assert {(5, 10, 3), (20, 30, 3), (11, 19, 1)} <= shapes
    assert (8, 15, 2) not in shapes, "the example with no-fly zones, which paper mode refuses"
    assert len({task.id for task in tasks}) == len(tasks) == 2 * len(shapes)
    assert source_tasks() == tasks, "generated from a fixed seed"
    alone = source_tasks([(5, 10, 3)])
    assert alone == [task for task in tasks if task.id.endswith("-5x10x3")]


def test_exploration_is_annealed_within_the_training():
    parameters = source_parameters(source_tasks([(2, 2, 1)])[0], 5000)
    assert (parameters.mode, parameters.n_epochs) == ("paper", 5000)
    assert parameters.epsilon_anneal_steps == 5000 * 5 // 2


def test_files_are_written_once_kept_and_replaced_when_parameters_change(tmp_path):
    tasks = source_tasks([(2, 2, 1), (1, 3, 2)], families=("uniform",))
    told = list(train_library(tasks, tmp_path, n_epochs=6, workers=1))
    assert {event.task.id for event in told if event.finished and not event.kept} == {t.id for t in tasks}
    files = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    assert set(files) == {"uniform-1x3x2.safetensors", "uniform-2x2x1.safetensors"}
    for task in tasks:
        data = files[f"{task.id}.safetensors"]
        verify(data, task.problem)
        metadata = decode(data).metadata
        assert problem_from_record(metadata["task"]) == task.problem
        assert (metadata["name"], metadata["metrics"]["epochs"]) == (task.name, 6)
        assert new_policy(task.name, task.problem, data, policy_id=task.id).id == task.id

    again = list(train_library(tasks, tmp_path, n_epochs=6, workers=1))
    assert [(event.kept, event.finished) for event in again] == [(True, True)] * 2
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == files

    (tmp_path / "uniform-1x3x2.safetensors").write_bytes(b"damaged")
    renamed = [replace(task, name=task.name + " b") if task.id == "uniform-2x2x1" else task for task in tasks]
    kept = [event for event in train_library(renamed, tmp_path, n_epochs=6, workers=1) if event.kept]
    assert kept == []
    assert (tmp_path / "uniform-1x3x2.safetensors").read_bytes() == files["uniform-1x3x2.safetensors"]


def test_leaving_early_leaves_no_half_trained_file(tmp_path):
    tasks = source_tasks([(2, 3, 1)], families=("uniform",))
    progress = train_library(tasks, tmp_path, n_epochs=1_000_000, workers=1)
    assert 0 < next(progress).fraction < 1
    progress.close()
    assert list(tmp_path.iterdir()) == []
