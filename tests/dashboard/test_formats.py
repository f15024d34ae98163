"""Files of the dashboard: what goes out comes back the same."""

import json
import random
import string
from pathlib import Path

from page_files import write_and_read
from page_modules import run_module

CASES = Path(__file__).parents[1] / "cases"


class Maker:
    """Makes values of JSON schemas, so that a field that is added later is tried too."""

    SPECIAL = (
        "=1+1",
        "@a",
        "+b",
        "-c",
        "\tt",
        "'=x",
        "''@",
        "'plain",
        "a,b",
        "a;b",
        'q"q',
        " edge ",
        "új 村 ‍",
        "#1",
        "007",
        "1,5",
        "true",
        "|",
        "line\nbreak",
        "﻿mark",
        "[1]",
        "<b>",
        "kind",
        "sep=;",
    )

    def __init__(self, seed, components, materials):
        self.random = random.Random(seed)
        self.components = components
        self.materials = materials
        self.count = 0

    def properties(self, name):
        return self.components[name]["properties"], self.components[name].get("required", [])

    def item(self, name):
        properties, required = self.properties(name)
        kept = {n: s for n, s in properties.items() if n in required or self.random.random() < 0.6}
        return {n: self.value(s, identifier=n == "id") for n, s in kept.items()} | {"id": self.identifier()}

    def identifier(self):
        self.count += 1
        return f"{self.random.choice(self.SPECIAL)}{self.count}{self.random.choice(self.SPECIAL)}"

    def number(self):
        kind = self.random.randrange(5)
        if kind == 0:
            return self.random.randrange(90)
        if kind == 1:
            return self.random.choice([1e-12, 5e-324, 1e9, 0.1 + 0.2, 1 / 3])
        return self.random.uniform(0, 90)

    def value(self, schema, identifier=False):
        if "anyOf" in schema:
            schema = next(each for each in schema["anyOf"] if each.get("type") != "null")
        if "$ref" in schema:
            schema = self.components[schema["$ref"].rsplit("/", 1)[1]]
        if "enum" in schema:
            return self.random.choice(schema["enum"])
        match schema.get("type"):
            case "number":
                return self.number()
            case "integer":
                return self.random.randrange(int(schema.get("maximum", 9)) + 1)
            case "boolean":
                return self.random.random() < 0.5
            case "string":
                return self.random.choice(self.SPECIAL) + self.random.choice(string.ascii_letters)
            case "array" if schema["items"].get("type") == "number":
                return [self.number() for _ in range(self.materials)]
            case "array":
                return [self.value(schema["items"]) for _ in range(self.random.randrange(3))]
            case "object":
                return {
                    name: self.value(each)
                    for name, each in schema.get("properties", {}).items()
                    if name in schema.get("required", []) or self.random.random() < 0.7
                }
        raise AssertionError(f"no value is known for {schema}")

    def problem(self):
        properties, _ = self.properties("ProblemModel")
        settings = {
            name: self.value(schema)
            for name, schema in properties.items()
            if name not in ("uavs", "targets") and self.random.random() < 0.7
        }
        uavs = [self.item("UAVModel") for _ in range(self.random.randrange(1, 5))]
        return settings | {"uavs": uavs, "targets": [self.item("TargetModel") for _ in range(4)]}


def meaning(problem):
    """A problem without settings that are not set, its zones and bases with the ids that they get."""
    given = {name: value for name, value in problem.items() if value != {}}
    for name, stem in (("no_fly_zones", "zone"), ("bases", "base")):
        if name in given:
            given[name] = [{"id": f"{stem}-{at}", **item} for at, item in enumerate(given[name], 1)]
    # No bases are none, whether a file says so or not.
    return {name: value for name, value in given.items() if name != "bases" or value}


def test_whatever_goes_out_comes_back_the_same(openapi):
    components = openapi["components"]["schemas"]
    problems = [Maker(seed, components, seed % 4 + 1).problem() for seed in range(60)]
    fields = {name for problem in problems for item in problem["targets"] for name in item}
    assert fields == set(components["TargetModel"]["properties"])

    found = write_and_read(openapi, problems)

    for problem, (as_json, as_csv, as_geojson) in zip(problems, found, strict=True):
        for again in (as_json, as_csv):
            assert again["notices"] == []
        assert meaning(as_json["problem"]) == meaning(problem)
        # What is not set stays as it is on screen where a file cannot say so; CSV says it.
        assert meaning(as_csv["problem"]) == meaning(problem)
        assert meaning(as_geojson["problem"]) == {"crs": "local", **meaning(problem)}


def test_a_planned_problem_stays_planned(openapi):
    problem = json.loads((CASES / "F10-planned-lost-by-csv.json").read_text())
    found = write_and_read(openapi, [problem])[0]
    assert [each["problem"]["objective"]["unloading"] for each in found] == ["planned"] * 3


def test_texts_are_no_formulas_in_a_table_and_come_back(openapi):
    problem = json.loads((CASES / "O3-csv-formulas.json").read_text())
    code = """
        const { fieldsOf } = await load("schema.js");
        return (await load("formats.js")).toCsv(given.problem, fieldsOf(given.openapi));
    """
    written = run_module(code, {"problem": problem, "openapi": openapi})
    assert '''"'=HYPERLINK(""http://x"",""y"")"''' in written
    assert "'@SUM(1+1)*cmd|" in written
    found = write_and_read(openapi, [problem])[0]
    for again in found:
        assert [each["id"] for each in again["problem"]["targets"]] == [
            each["id"] for each in problem["targets"]
        ]


def test_bases_go_out_and_come_back(openapi):
    uav = {"id": "u", "x_s": 1, "y_s": 2, "speed": 3, "voyage": 40, "loadlist": [5, 6]}
    problem = {
        "uavs": [{**uav, "full_load": [7, 8], "bases": ["depot"]}],
        "targets": [{"id": "a", "x": 1, "y": 1, "level": 1, "loadlist": [2, 0]}],
        "bases": [
            {"id": "depot", "x": 3, "y": 4, "stock": [9, 0], "turnaround": 0.5, "name": "=Depot"},
            {"id": "spare", "x": 5, "y": 6},
        ],
        "crs": "local",
    }
    (found,) = write_and_read(openapi, [problem])
    for again in found:
        assert again["problem"]["bases"] == problem["bases"]
        assert again["problem"]["uavs"] == problem["uavs"]
        assert again["notices"] == []
