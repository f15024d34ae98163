"""The bound beside the plan: only where it is asked for, within its time, never below the reward."""

import pytest

from app.allocation import tasks
from app.allocation.answer_time import AnswerTime
from app.allocation.time_limit import TimeLimit
from app.api.openapi_examples import example_problem
from app.api.problem_models import ProblemModel, to_problem
from app.domain.records import problem_from_record, problem_to_record
from app.jobs.worker import CANCEL, WorkContext, new_control
from app.settings import Settings


def payload(**more):
    problem = problem_to_record(to_problem(ProblemModel(**example_problem("paper-5x10")), Settings()))
    given = {"algorithm": "greedy", "parameters": {}, "seed": 1, "library_url": None}
    return {"problem": problem, **given, **more}


def test_the_answer_has_bound_and_gap_where_asked(client):
    body = {**example_problem("paper-5x10"), "algorithm": "local_search", "bound": True}

    answer = client.post("/allocate", json=body).json()

    assert answer["bound"] >= answer["reward"] > 0
    assert answer["gap"] == pytest.approx((answer["bound"] - answer["reward"]) / answer["bound"])
    assert answer["gap"] < 0.1


def test_without_asking_there_is_none(client):
    body = {**example_problem("paper-5x10"), "algorithm": "greedy"}

    answer = client.post("/allocate", json=body).json()

    assert answer["bound"] is None
    assert answer["gap"] is None


@pytest.mark.parametrize("wrong", [{"bound": 1}, {"bound_time_limit_s": 0}, {"bound_time_limit_s": 1e9}])
def test_what_is_wrong_is_named(client, wrong):
    response = client.post("/allocate", json={**example_problem("paper-5x10"), **wrong})

    assert response.status_code == 422
    assert response.json()["errors"][0]["pointer"] == f"/{next(iter(wrong))}"


def test_a_cancelled_search_has_a_bound_too():
    control = new_control()
    control[CANCEL] = 1.0

    result = tasks.allocate(
        payload(bound_time_limit_s=5.0), WorkContext(lambda _progress: None, control)
    ).result

    assert result["bound"] >= result["reward"]


def test_a_share_of_the_time_limit_is_kept_for_it():
    problem = problem_from_record(payload()["problem"])
    search_only, with_bound = (
        TimeLimit(
            WorkContext.in_process(lambda _progress: None, 6.0), AnswerTime(), problem, bound_limit_s
        ).searching.seconds_left()
        for bound_limit_s in (None, 100.0)
    )

    assert with_bound == pytest.approx(search_only * 2 / 3, rel=0.05)


def test_more_time_gives_no_higher_bound():
    problem = example_problem("paper-5x10")
    problem["targets"] = [
        {**target, "id": f"{target['id']}-{copy}", "x": target["x"] + 0.01 * copy}
        for copy in range(2)
        for target in problem["targets"]
    ]
    given = payload(
        problem=problem_to_record(to_problem(ProblemModel(**problem), Settings())), bound_time_limit_s=0.01
    )
    context = WorkContext.in_process(lambda _progress: None)
    quick = tasks.allocate(given, context).result
    longer = tasks.allocate({**given, "bound_time_limit_s": 1.0}, context).result

    assert quick["bound"] >= longer["bound"] >= longer["reward"]
