"""The reference of the fields says what their declaration says."""

from app.domain import reference
from app.domain.fields import declared_fields
from app.domain.problem import UAV, Objective, Problem, Target


def test_the_tables_are_those_of_the_declaration():
    page = reference.PAGE.read_text(encoding="utf-8")
    assert reference.with_tables(page) == page, "python -m app.domain.reference writes them anew"
    for of in (UAV, Target, Problem, Objective):
        assert reference.table_of(of) in page
        for field in declared_fields(of):
            assert f"| `{field.name}` | {field.sentence} |" in page
