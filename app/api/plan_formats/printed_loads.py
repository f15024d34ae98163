"""Who takes what, and what bases have left: the tables of a printed page for people at the bases."""

from __future__ import annotations

from html import escape

from app.api.plan_formats.flown_plan import FlownPlan
from app.api.plan_formats.load_sheet import Loading, loadings
from app.api.plan_formats.printed_text import amounts_text, called, materials_text, time_text


def load_tables(plan: FlownPlan) -> str:
    """Write the load sheet, and the stock of every base before and after the plan."""
    rows = "".join(_row(plan, each) for each in loadings(plan))

    def materials(title: str) -> str:
        return escape(materials_text(plan, title))

    stocks = "".join(
        f'<tr><td>{escape(called(each.base))}</td><td class="n">{_stock(each.base.stock)}</td>'
        f'<td class="n">{_stock(each.amounts)}</td></tr>'
        for each in plan.stocks
    )
    return (
        "<section><h2>Load sheet</h2><table><thead><tr><th>Where</th><th>UAV</th>"
        '<th class="n">Flight</th><th class="n">Lands</th><th class="n">Takes off</th>'
        f'<th class="n">{materials("Load")}</th><th class="n">{materials("Aboard")}</th>'
        "<th>Done</th></tr></thead>"
        f"<tbody>{rows}</tbody></table></section>"
        f'<section><h2>Stocks</h2><table><thead><tr><th>Base</th><th class="n">{materials("Before")}</th>'
        f'<th class="n">{materials("After")}</th></tr></thead><tbody>{stocks}</tbody></table></section>'
    )


def _row(plan: FlownPlan, each: Loading) -> str:
    where = "start" if each.base is None else called(each.base)
    lands = "" if each.landing_time is None else time_text(plan, each.landing_time)
    takes_off = "" if each.take_off_time is None else time_text(plan, each.take_off_time)
    return (
        f"<tr><td>{escape(where)}</td><td>{escape(called(each.uav))}</td>"
        f'<td class="n">{each.flight}</td><td class="n">{lands}</td><td class="n">{takes_off}</td>'
        f'<td class="n">{amounts_text(each.loaded)}</td><td class="n">{amounts_text(each.aboard)}</td>'
        '<td class="done">☐</td></tr>'
    )


def _stock(amounts: tuple[float, ...] | None) -> str:
    return "as much as is asked for" if amounts is None else amounts_text(amounts)
