"""Lists of places come into the page: chosen, dropped or pasted, with their columns assigned in a dialog."""

import json

import pytest
from dashboard_steps import begin_again, open_problem, state
from playwright.sync_api import expect

LIST = "Lieu;Latitude;Longitude;Besoin\nDondo;-19,61;34,74;20\nBúzi;-19,88;34,6;5\n"
DROP = """([name, text]) => {
    const data = new DataTransfer();
    data.items.add(new File([text], name, { type: "text/plain" }));
    const over = new DragEvent("dragover", { dataTransfer: data, bubbles: true, cancelable: true });
    document.getElementById("dock").dispatchEvent(over);
    const seen = !document.querySelector(".drop-here").hidden;
    const drop = new DragEvent("drop", { dataTransfer: data, bubbles: true, cancelable: true });
    document.getElementById("dock").dispatchEvent(drop);
    return [seen, over.defaultPrevented, drop.defaultPrevented];
}"""
PASTE = """([text, selector]) => {
    const data = new DataTransfer();
    data.setData("text/plain", text);
    const pasted = new ClipboardEvent("paste", { clipboardData: data, bubbles: true, cancelable: true });
    document.querySelector(selector).dispatchEvent(pasted);
    return pasted.defaultPrevented;
}"""


@pytest.fixture
def page(shared_page):
    yield begin_again(shared_page)
    if shared_page.locator("#import-dialog").count():
        shared_page.locator("#import-dialog").get_by_role("button", name="Cancel").click()


@pytest.fixture
def dialog(page):
    return page.locator("#import-dialog")


def choose(page, text, name="places.csv"):
    page.locator("#import").set_input_files({"name": name, "mimeType": "text/plain", "buffer": text.encode()})


def columns(dialog):
    dialog.locator("thead select").first.wait_for()
    return dialog.locator("thead select").evaluate_all(
        "all => all.map((each) => each.selectedOptions[0].text)"
    )


def test_a_list_is_added_with_its_columns_guessed_and_taken_back_in_one_step(page, dialog):
    open_problem(
        page,
        {
            "crs": "wgs84",
            "uavs": [],
            "targets": [{"id": "a", "x": 34, "y": -19, "level": 3, "loadlist": [7]}],
        },
    )
    before = state(page, "problem")
    choose(page, LIST)
    assert columns(dialog) == ["name", "latitude", "longitude", "need 1"]
    expect(dialog.get_by_role("status")).to_have_text("2 areas of 2 rows can be read.")
    expect(dialog.get_by_label("urgency, of all")).to_have_value("3")
    dialog.get_by_label("urgency, of all").fill("2")
    dialog.get_by_role("button", name="Import").click()
    expect(page.locator(".symbol.targets")).to_have_count(3)
    assert state(page, "problem")["targets"][1:] == [
        {"id": "area-2", "name": "Dondo", "x": 34.74, "y": -19.61, "level": 2, "loadlist": [20]},
        {"id": "area-3", "name": "Búzi", "x": 34.6, "y": -19.88, "level": 2, "loadlist": [5]},
    ]
    page.locator("body").press("Control+z")
    assert state(page, "problem") == before


def test_an_example_that_nobody_changed_gives_way_to_a_list(browser, service):
    context = browser.new_context()
    page = context.new_page()
    page.goto(service.url)
    page.wait_for_selector("html[data-ready]")
    choose(page, LIST, "villages.csv")
    page.locator("#import-dialog").get_by_role("button", name="Import").click()
    expect(page.locator("#problem-title")).to_have_text("villages · 0 UAVs, 2 areas")
    assert state(page, "problem")["crs"] == "wgs84"
    context.close()


def test_columns_are_assigned_by_hand_each_to_one_field(page, dialog):
    choose(page, "ort;b;l;n\nDondo;-19,61;34,74;20\n")
    assert columns(dialog) == ["name", "latitude", "longitude", "need: n"]
    expect(dialog.locator("[data-says]:visible")).to_have_count(0)
    dialog.get_by_label("What the column n is").select_option(label="urgency")
    expect(dialog.locator("[data-says=no-amounts]")).to_contain_text("No column says what the areas need")
    dialog.get_by_label("What the column b is").select_option(label="longitude")
    assert columns(dialog) == ["name", "longitude", "left out", "urgency"]
    expect(dialog.locator("[data-says=left-out]")).to_have_text("1 column is left out: l")
    expect(dialog.get_by_role("alert")).to_contain_text("No column is latitude: choose it above")
    expect(dialog.get_by_role("button", name="Import")).to_be_disabled()
    dialog.get_by_label("What the column l is").select_option(label="latitude")
    dialog.get_by_label("need 1, of all").fill("4")
    dialog.get_by_label("What to do with them").select_option(
        label="Put them in the place of the areas that are there"
    )
    dialog.get_by_role("button", name="Import").click()
    expect(page.locator(".symbol.targets")).to_have_count(1)
    problem = state(page, "problem")
    assert problem["targets"] == [
        {"id": "area-1", "name": "Dondo", "x": -19.61, "y": 34.74, "level": 20, "loadlist": [4]}
    ]
    assert len(problem["uavs"]) == 11


def test_rows_that_cannot_be_read_are_named_and_left_out_only_when_asked(page, dialog):
    choose(page, LIST + "Nowhere;north;34;1\n")
    alert = dialog.get_by_role("alert")
    expect(alert).to_contain_text("line 4: `latitude (Latitude)` is no number: north")
    expect(alert).to_contain_text("A row of these columns is right like this: Dondo;-19,61;34,74;20")
    expect(dialog.get_by_role("button", name="Import")).to_be_disabled()
    dialog.get_by_label("Leave out the rows that cannot be read").check()
    dialog.get_by_label("What to do with them").select_option(label="Begin a new problem with them")
    dialog.get_by_role("button", name="Import").click()
    expect(page.locator("#problem-title")).to_have_text("places · 0 UAVs, 2 areas")


def test_a_file_is_dropped_anywhere(page, dialog):
    page.click("#tab-answer")
    assert page.evaluate(DROP, ["list.csv", LIST]) == [True, True, True]
    expect(dialog.get_by_role("heading")).to_have_text("Import list.csv")
    expect(page.locator(".drop-here")).to_be_hidden()
    page.keyboard.press("Escape")
    expect(dialog).to_have_count(0)
    whole = json.dumps({"crs": "local", "uavs": [], "targets": []})
    page.evaluate(DROP, ["whole.json", whole])
    expect(page.locator("#problem-title")).to_have_text("whole · 0 UAVs, 0 areas")


def test_a_table_is_pasted_outside_of_fields_and_words_are_not(page, dialog):
    page.click("[data-table=targets]")
    assert page.evaluate(PASTE, ["only words, and no numbers\n", "body"]) is False
    assert page.evaluate(PASTE, [LIST, "#import"]) is False
    expect(dialog).to_have_count(0)
    assert page.evaluate(PASTE, [LIST.replace(";", "\t"), "body"]) is True
    assert columns(dialog) == ["name", "latitude", "longitude", "need 1"]


def test_points_of_a_map_keep_their_degrees(page, dialog):
    open_problem(page, {"crs": "local", "uavs": [], "targets": []})
    point = {
        "type": "Feature",
        "properties": {"name": "A"},
        "geometry": {"type": "Point", "coordinates": [34, -19]},
    }
    choose(page, json.dumps({"type": "FeatureCollection", "features": [point]}), "points.geojson")
    expect(dialog.get_by_label("Positions")).to_be_disabled()
    ways = dialog.get_by_label("What to do with them").locator("option").all_inner_texts()
    assert ways == ["Begin a new problem with them"]


def test_a_template_comes_back_as_it_went(page, dialog):
    with page.expect_download() as saved:
        page.click("[data-template=uavs]")
    choose(page, saved.value.path().read_text("utf-8"))
    assert columns(dialog) == ["name", "start latitude", "start longitude", "speed", "range", "load 1"]
    expect(dialog.get_by_role("button", name="Import")).to_be_enabled()


VILLAGES = """village,lat,lon,priority,deadline (h),water,food,medicine,remarks
Barpak,28.205,84.742,3,1.0,10,8,4,by road
Laprak,28.222,84.799,3,,8,6,2,
"""


def test_needs_by_material_are_seen_named_and_taken_back(page, dialog):
    open_problem(page, {"crs": "wgs84", "uavs": [], "targets": []})
    page.set_viewport_size({"width": 820, "height": 800})
    page.evaluate(PASTE, [VILLAGES, "body"])
    needs = ["need: water", "need: food", "need: medicine"]
    assert columns(dialog) == ["name", "latitude", "longitude", "urgency", "deadline", *needs, "left out"]
    expect(dialog.locator("[data-says=left-out]")).to_have_text("1 column is left out: remarks")
    expect(dialog.locator("[data-says=no-amounts]")).to_be_hidden()
    # Every column can be brought into sight, and the dialog itself does not move sideways.
    last = dialog.get_by_label("What the column remarks is")
    last.scroll_into_view_if_needed()
    right = dialog.evaluate("(each) => each.getBoundingClientRect().right")
    assert last.bounding_box()["x"] + last.bounding_box()["width"] <= right
    assert dialog.evaluate("(each) => each.scrollWidth <= each.clientWidth")
    page.set_viewport_size({"width": 1366, "height": 900})
    dialog.get_by_role("button", name="Import").click()
    problem = state(page, "problem")
    assert [each["loadlist"] for each in problem["targets"]] == [[10, 8, 4], [8, 6, 2]]
    heads = page.locator(".grid[data-kind=targets] thead th")
    for need in needs:
        expect(heads.filter(has_text=need)).to_have_count(1)
    # The materials' names are fields among the settings.
    page.locator("summary", has_text="Settings of the problem").click()
    first = page.get_by_label("Name of material 1")
    expect(first).to_have_value("water")
    first.fill("Water, l")
    first.press("Enter")
    expect(heads.filter(has_text="need: Water, l")).to_have_count(1)
    assert state(page, "problem")["materials"][0] == {"name": "Water, l"}
    page.locator("body").press("Control+z")
    page.locator(".notice", has_text="2 areas of what was pasted are here").get_by_role(
        "button", name="Undo"
    ).click()
    expect(page.locator(".symbol.targets")).to_have_count(0)
    assert state(page, "problem")["targets"] == []
