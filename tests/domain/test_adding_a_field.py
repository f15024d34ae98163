"""A field that is declared is everywhere: a copy of the program gets some, one line each, and has them."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from page_modules import MODULES, run_module

from app.domain.fields import declared_fields
from app.domain.problem import UAV, Objective, Problem, Target

ROOT = Path(__file__).parents[2]
ADDED = {
    # The last line of a class, and what is declared after it.
    "requested: Annotated[": [
        'access: Annotated[float, Number(low=0.0, high=1.0), "How easily it is reached"] = 0.5',
        'opens: Annotated[float | None, Number(unit=TIME), "A visit begins no sooner"] = None',
        'covered: Annotated[bool, Flag(), "Whether there is a roof"] = False',
        'helps: Annotated[tuple[str, ...], text_fields.Words(), "What it takes to help there"] = ()',
        'called: Annotated[str | None, text_fields.Name(), "Its name for people"] = None',
        'kept: Annotated[dict[str, object] | None, text_fields.Properties(), "Of the client"] = None',
        'ground: Annotated[str, Choice(("sand", "rock")), "What it stands on"] = "rock"',
    ],
    'loadlist: Annotated[tuple[float, ...], Amounts(), "Amounts carried': [
        'full_load: Annotated[tuple[float, ...] | None, Amounts(same_as="loadlist"), "What it takes"] = '
        "field(default=None, kw_only=True)",
    ],
}
ASK = """
import json, pathlib, sys
from dataclasses import replace
import app
from app.api.allocation_models import AllocationRequest
from app.api.application import create_application
from app.api.body_validation import BodyValidator
from app.api.errors import InvalidBody
from app.api.json_body import read_body
from app.api.problem_models import to_problem
from app.api.plan_formats.flown_plan import flown_plan
from app.api.plan_formats.geojson import geojson
from app.domain import reference
from app.domain.errors import InvalidProblem
from app.domain.problem import Problem, Target
from app.domain.records import problem_from_record, problem_to_record
from app.settings import Settings

def taken(**fields):
    body = json.loads(sys.argv[1])
    for name, value in fields.items():
        body["uavs" if name == "full_load" else "targets"][0][name] = value
    try:
        model = read_body(json.dumps(body).encode(), BodyValidator(AllocationRequest), Settings())
        return to_problem(model, Settings())
    except InvalidBody as error:
        return [[each.pointer, each.detail] for each in error.errors]

def refused(problem, **fields):
    try:
        replace(problem, targets=(replace(problem.targets[0], **fields),))
    except InvalidProblem as error:
        return [[each.pointer, each.detail] for each in error.violations]

plain = taken()
full = taken(access=0.25, opens=3, covered=True, ground="sand", full_load=[7.0], **json.loads(sys.argv[2]))
record = problem_to_record(full)
stays = {"uav_id": full.uavs[0].id, "distance": 0.0, "return_distance": 0.0, "stops": []}
plan = {"job_id": "1", "algorithm": "greedy", "reward": 0.0, "satisfaction": 0.0, "distance": 0.0,
        "routes": [stays], "unmet": []}
older = problem_to_record(full)
del older["targets"][0]["access"]
print(json.dumps({
    "file": app.__file__,
    "refused": [refused(plain, access=1.5), refused(plain, ground="ice"), refused(plain, opens=1e13)],
    "tiny": replace(plain, targets=(replace(plain.targets[0], access=1e-200),)).targets[0].access,
    "record": [record["targets"][0], record["uavs"][0]["full_load"], problem_from_record(record) == full],
    "default": [plain.targets[0].access, problem_from_record(older).targets[0].access],
    "same": [plain == taken(full_load=[5.0]), plain == full],
    "refused on the wire": [taken(access=1.5), taken(ground="ice"), taken(covered=1), taken(full_load=[])],
    "openapi": create_application(Settings(data_dir=pathlib.Path("data"))).openapi(),
    "texts": [
        refused(full, helps=("a", "b\\n")), refused(full, called="\\t"),
        refused(full, kept={"a": 5000 * "b"}),
    ],
    "exported": json.loads(geojson(flown_plan(full, plan)))["features"],
    "reference": reference.table_of(Target),
}))
"""
BODY = {
    "uavs": [{"x_s": 0, "y_s": 0, "speed": 1, "voyage": 9, "loadlist": [5.0]}],
    "targets": [{"x": 1, "y": 0, "level": 1, "loadlist": [2.0]}],
}
TEXTS = {"helps": ["medic", "=night, rain"], "called": "Kiliwa", "kept": {"ref": [1, {"a": None}]}}
SET = {"access": 0.25, "opens": 3, "covered": True, "ground": "sand", **TEXTS}


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """What the program with the added fields answers."""
    copy = tmp_path_factory.mktemp("copy")
    for folder in ("app", "policy_store"):
        shutil.copytree(ROOT / folder, copy / folder, ignore=shutil.ignore_patterns("__pycache__"))
    declaration = copy / "app/domain/problem.py"
    text = declaration.read_text(encoding="utf-8")
    for before, lines in ADDED.items():
        assert text.count(f"    {before}") == 1
        text = text.replace(f"    {before}", "".join(f"    {line}\n" for line in lines) + f"    {before}")
    text = text.replace(
        "from app.domain.errors", "from app.domain import text_fields\nfrom app.domain.errors", 1
    )
    declaration.write_text(text, encoding="utf-8")
    ended = subprocess.run(
        [sys.executable, "-c", ASK, json.dumps(BODY), json.dumps(TEXTS)],
        cwd=copy,
        env=os.environ | {"PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    answer = json.loads(ended.stdout)
    assert Path(answer["file"]).is_relative_to(copy)
    return answer


def test_the_domain_checks_it(found):
    assert found["refused"] == [
        [["/targets/0/access", "1.5 is not in 0..1"]],
        [["/targets/0/ground", "'ice' is neither 'sand' nor 'rock'"]],
        [["/targets/0/opens", "1e+13 is not in -1e+12..1e+12"]],
    ]
    assert found["tiny"] == 0.0
    (helps,), (called,), (kept,) = found["texts"]
    assert (helps[0], called[0]) == ("/targets/0/helps/1", "/targets/0/called")
    assert kept == ["/targets/0/kept", "5008 bytes as JSON, at most 4096"]


def test_records_have_it_and_older_ones_its_default(found):
    target, full_load, came_back = found["record"]
    assert {name: target[name] for name in SET} == SET
    assert full_load == [7.0]
    assert came_back
    assert found["default"] == [0.5, 0.5]


def test_requests_have_it(found):
    assert found["same"] == [True, False]
    assert found["refused on the wire"] == [
        [["/targets/0/access", "is 1.5, must be at most 1"]],
        [["/targets/0/ground", "must be 'sand' or 'rock'"]],
        [["/targets/0/covered", "is 1, needs true or false"]],
        [["/uavs/0/full_load", "has 0 elements, must have at least 1"]],
    ]


def test_the_description_of_the_service_has_it(found):
    schemas = found["openapi"]["components"]["schemas"]
    properties = schemas["TargetModel"]["properties"]
    assert properties["access"] == {
        "type": "number",
        "minimum": 0.0,
        "maximum": 1.0,
        "default": 0.5,
        "title": "Access",
        "description": "How easily it is reached",
    }
    assert properties["opens"]["anyOf"][1] == {"type": "null"}
    assert properties["ground"]["enum"] == ["sand", "rock"]
    amounts, _null = schemas["UAVModel"]["properties"]["full_load"]["anyOf"]
    assert amounts["maxItems"] == schemas["UAVModel"]["properties"]["loadlist"]["maxItems"]


def test_the_reference_has_it(found):
    assert "| `access` | How easily it is reached |  | 0 to 1 | `0.5` |" in found["reference"]
    assert "| `opens` | A visit begins no sooner | time units, or h |  | `null` |" in found["reference"]


def test_the_plan_as_geojson_has_it(found):
    uav, area = (feature["properties"] for feature in found["exported"])
    assert uav["full_load"] == [7.0]
    assert {name: area[name] for name in SET} == SET


def test_the_pages_files_have_it(found):
    code = """
        const { fieldsOf } = await load("schema.js");
        const formats = await load("formats.js");
        const fields = fieldsOf(given.openapi);
        return ["toJson", "toCsv", "toGeoJson"].map((write) => {
            const text = formats[write](given.problem, fields);
            return [text, formats.read(new TextEncoder().encode(text), { uavs: [], targets: [] }, fields)];
        });
    """
    problem = {
        "crs": "local",
        "uavs": [{**BODY["uavs"][0], "id": "u", "full_load": [7]}],
        "targets": [{**BODY["targets"][0], "id": "a", **SET}],
    }
    files = run_module(code, {"openapi": found["openapi"], "problem": problem})
    for _, read in files:
        assert read["notices"] == []
        assert {name: read["problem"][name] for name in problem} == problem
    head = files[1][0].splitlines()[0].split(",")
    assert {*SET, "load_1", "full_load_1"} <= set(head)


POSITIONS = {"x", "y", "x_s", "y_s", "x_c", "y_c", "crs", "id"}
LISTS = {"uavs", "targets"}


@pytest.mark.parametrize(
    ("file", "needed"),
    [
        # Rows and features are of one list or the other; amounts of the load are columns `load_1`, ….
        ("schema.js", LISTS),
        # The third is a word of its sentences.
        ("formats.js", LISTS | {"id", "bases"}),
        ("fields.js", {"id"}),
        ("kinds.js", LISTS | {"id", "bases", "no_fly_zones"}),
        ("formats/cells.js", set()),
        ("formats/csv.js", LISTS | {"loadlist"}),
        ("formats/geojson.js", LISTS | POSITIONS),
    ],
)
def test_the_page_names_no_field_it_need_not(file, needed):
    declared = {field.name for of in (UAV, Target, Objective, Problem) for field in declared_fields(of)}
    # Words of the language, of JSON Schema and of GeoJSON.
    declared -= {"name", "properties"}
    text = re.sub(r"/\*.*?\*/|//.*", "", (MODULES / file).read_text(encoding="utf-8"), flags=re.DOTALL)
    named = set(re.findall(r"(?<![\w/])[a-z_]+(?!\w)", text)) & declared
    assert named <= needed
