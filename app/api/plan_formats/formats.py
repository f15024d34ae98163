"""Every format that a plan can be taken away in: who writes it, its media type and its file's ending."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from app.api.plan_formats.briefing import briefing
from app.api.plan_formats.csv_table import csv_table
from app.api.plan_formats.flown_plan import FlownPlan
from app.api.plan_formats.geojson import MEDIA_TYPE as GEOJSON
from app.api.plan_formats.geojson import geojson
from app.api.plan_formats.launches import PlannedFlight
from app.api.plan_formats.load_sheet import load_sheet
from app.api.plan_formats.map_files import GPX_TYPE, KML_TYPE, gpx, kml
from app.api.plan_formats.printed_page import printed_page
from app.api.plan_formats.qgroundcontrol import plan_file, waypoint_file


class PlanFormat(StrEnum):
    """What a plan can be taken away as."""

    GEOJSON = "geojson"
    QGC_PLAN = "qgc-plan"
    QGC_WPL = "qgc-wpl"
    CSV = "csv"
    LOAD_SHEET = "load-sheet"
    HTML = "html"
    BRIEFING = "briefing"
    KML = "kml"
    GPX = "gpx"


@dataclass(frozen=True, slots=True)
class Document:
    """A format of the whole plan."""

    write: Callable[[FlownPlan], str]
    media_type: str
    ending: str


@dataclass(frozen=True, slots=True)
class FlightsDocument:
    """A format of all flights, as they are to be flown."""

    write: Callable[[FlownPlan, Sequence[PlannedFlight]], str]
    media_type: str
    ending: str


@dataclass(frozen=True, slots=True)
class FlightFile:
    """A format of one flight."""

    write: Callable[[PlannedFlight], str]
    media_type: str
    ending: str


def _for_spreadsheets(write: Callable[[FlownPlan], str]) -> Document:
    """Write CSV with a byte order mark where a spreadsheet would take it for another encoding."""

    def marked(plan: FlownPlan) -> str:
        table = write(plan)
        return table if table.isascii() else "\ufeff" + table

    return Document(marked, "text/csv; charset=utf-8", "csv")


FORMATS: dict[PlanFormat, Document | FlightsDocument | FlightFile] = {
    PlanFormat.GEOJSON: Document(geojson, GEOJSON, "geojson"),
    PlanFormat.CSV: _for_spreadsheets(csv_table),
    PlanFormat.LOAD_SHEET: _for_spreadsheets(load_sheet),
    PlanFormat.HTML: Document(printed_page, "text/html; charset=utf-8", "html"),
    PlanFormat.BRIEFING: FlightsDocument(briefing, "text/plain; charset=utf-8", "txt"),
    PlanFormat.KML: FlightsDocument(kml, KML_TYPE, "kml"),
    PlanFormat.GPX: FlightsDocument(gpx, GPX_TYPE, "gpx"),
    PlanFormat.QGC_PLAN: FlightFile(
        lambda each: plan_file(each.flight, each.choices, each.warnings), "application/json", "plan"
    ),
    PlanFormat.QGC_WPL: FlightFile(
        lambda each: waypoint_file(each.flight, each.choices), "text/plain; charset=utf-8", "waypoints"
    ),
}
