"""Files of plans that are safe to open: no formulas, no broken names, and maps that are whole."""

import csv
import io
import itertools
import json
import re
from pathlib import Path

import numpy as np
import pytest

from app.api.plan_formats.csv_table import csv_table
from app.api.plan_formats.flown_plan import flown_plan
from app.api.plan_formats.printed_page import printed_page
from app.api.problem_models import ProblemModel, to_problem
from app.settings import Settings

CASES = Path(__file__).parents[1] / "cases"

UAV = {"speed": 1, "voyage": 1e6, "loadlist": [1]}
AREA = {"level": 1, "loadlist": [1]}


def plan_of(**problem):
    """A plan in which each UAV flies to every area, in turn; its numbers mean nothing."""
    problem = to_problem(ProblemModel(**problem), Settings())
    stops = [
        {
            "target_id": target.id,
            "step": 1,
            "arrival_time": 0.1,
            "distance": 1.0,
            "delivered": [0.0] * len(target.loadlist),
        }
        for target in problem.targets
    ]
    routes = [
        {"uav_id": uav.id, "distance": 1.0, "return_distance": 1.0, "stops": stops} for uav in problem.uavs
    ]
    told = {"job_id": "0" * 32, "algorithm": "exact", "reward": 1.0, "satisfaction": 1.0, "distance": 1.0}
    return flown_plan(problem, {**told, "routes": routes, "unmet": []})


def csv_of(client, answer):
    return client.get(f"/jobs/{answer['job_id']}/plan", params={"format": "csv"})


HOSTILE = ("=cmd|' /C calc'!A0", "@SUM(1)", "+1", "-5", "'=1", "''-1", "'quoted", "plain", "=1,2", "-5\u00e9")


def test_no_spreadsheet_takes_an_id_for_a_formula_and_every_id_comes_back():
    for ids in itertools.permutations(HOSTILE, 2):
        uavs = [{**UAV, "id": each, "x_s": 34.0, "y_s": -19.0} for each in ids]
        areas = [{**AREA, "id": each, "x": 34.0, "y": -19.0} for each in ids]
        rows = list(csv.DictReader(io.StringIO(csv_table(plan_of(uavs=uavs, targets=areas)))))
        for row in rows:
            for written in filter(None, (row["uav_id"], row["target_id"])):
                assert written[0] not in "=+-@\t\r"
                # What the dashboard's import does.
                read = written[1:] if re.match(r"'+[=+\-@\t\r]", written) else written
                assert read in ids
        assert {row["x"] for row in rows} >= {"34.0"}  # numbers stay numbers
        assert {row["y"] for row in rows} >= {"-19.0"}


def test_the_cases_with_formulas_are_taken_away_as_texts(client):
    for name in ("O3-csv-formulas", "hostile-ids"):
        body = json.loads((CASES / f"{name}.json").read_text("utf-8"))
        body = {**body.get("problem", body), "algorithm": "greedy", "parameters": {}}
        answer = client.post("/allocate", json=body)
        assert answer.status_code == 200, answer.text
        text = csv_of(client, answer.json()).text.removeprefix("\ufeff")
        for row in csv.reader(io.StringIO(text)):
            for cell in row:
                number = re.fullmatch(r"-?[0-9.e+-]+", cell)
                assert number or not cell.startswith(("=", "+", "-", "@", "\t", "\r")), cell


@pytest.mark.parametrize(("identifier", "marked"), [("uav 1", False), ("\u98db\u884c\u6a5f", True)])
def test_csv_says_its_encoding_where_a_spreadsheet_would_take_another(client, problem, identifier, marked):
    body = {**problem, "algorithm": "greedy"}
    body["uavs"] = [{**uav, "id": f"{identifier}-{n}"} for n, uav in enumerate(problem["uavs"])]
    content = csv_of(client, client.post("/allocate", json=body).json()).content
    assert content.startswith(b"\xef\xbb\xbf") is marked
    assert f"{identifier}-0" in content.decode("utf-8-sig")


def lines_of(page):
    found = re.findall(r'<polyline points="([^"]*)"', page)
    return [[tuple(map(float, pair.split(","))) for pair in line.split()] for line in found]


def test_the_printed_map_is_whole_across_the_antimeridian():
    case = json.loads((CASES / "F7-printed-map-antimeridian.json").read_text("utf-8"))
    case = {name: value for name, value in case.items() if name != "algorithm"}
    page = printed_page(plan_of(**case))

    def west(x):
        return x - 10 - 360 * (x - 10 > 180) + 360 * (x - 10 < -180)

    moved = {
        "uavs": [{**uav, "x_s": west(uav["x_s"])} for uav in case["uavs"]],
        "targets": [{**target, "x": west(target["x"])} for target in case["targets"]],
    }
    elsewhere = printed_page(plan_of(**(case | moved)))
    assert all(x < 175 for x in (each["x"] for each in moved["targets"]))
    for line, same in zip(lines_of(page), lines_of(elsewhere), strict=True):
        assert np.allclose(line, same, atol=0.11)


def test_a_leg_that_leaves_the_map_comes_in_at_the_other_edge():
    """Three places around the globe: wherever the map begins, one leg of the round trip crosses its edge."""
    areas = [{**AREA, "x": x, "y": 10} for x in (120, -120)]
    page = printed_page(plan_of(uavs=[{**UAV, "x_s": 0, "y_s": 0}], targets=areas, crs="wgs84"))
    first, second = lines_of(page)
    assert len(first) + len(second) == 6
    longest = 120 * (720 - 48) / 240
    for line in (first, second):
        assert all(abs(b[0] - a[0]) < longest + 1 for a, b in itertools.pairwise(line))
