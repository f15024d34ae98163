"""The descriptions of fields that the forms of the page show."""

from __future__ import annotations

from typing import Any

from page_modules import run_module

from app.solvers.registry import ALGORITHMS

_SHOWN = """
    const { forPeople } = await load("fields.js");
    const { fieldsOf, resolved } = await load("schema.js");
    const types = ["number", "integer", "boolean", "string"];
    const single = ({ type, enum: words }) => words || types.includes(type);
    const fields = fieldsOf(given.openapi);
    const parts = Object.values(fields.settings).map(({ properties }) => properties ?? {});
    const ofProblems = [fields.uavs, fields.targets, fields.settings, ...parts];
    const all = (groups) => groups.flatMap((group) => Object.values(group)).filter(single);
    const ofAlgorithm = ({ properties = {}, $defs }) =>
        Object.values(properties).map((each) => resolved(each, $defs));
    const plain = [...all([fields.request, fields.mission]), ...given.parameters.flatMap(ofAlgorithm)];
    const shownOn = (globe) => ({ description }) => forPeople(description, globe);
    const shown = [
        ...[...all(ofProblems), ...plain].map(shownOn(false)),
        ...all(ofProblems).map(shownOn(true)),
    ];
    return [...new Set(shown.filter(Boolean))];
"""


def shown_descriptions(openapi: dict[str, Any]) -> set[str]:
    """Return them in English, as they are shown on a plane and on the globe."""
    parameters = [each.parameter_model().model_json_schema() for each in ALGORITHMS.values()]
    return set(run_module(_SHOWN, {"openapi": openapi, "parameters": parameters}))
