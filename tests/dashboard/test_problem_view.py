"""The problem on the dashboard: examples, map, tables, files; what is on screen is what the service has.

Tests share a page: each begins by opening a problem, which replaces what another has left.
"""

import json
from itertools import count

import httpx
import pytest
from playwright.sync_api import expect

LOCAL = {
    "max_steps": 3,
    "crs": "local",
    "objective": {"distance_weight": 0.5, "return_to_base": True, "charge_return": True},
    "uavs": [
        {"id": 'a, "quoted"', "x_s": 0, "y_s": 0, "x_c": 1.5, "y_c": 2, "speed": 2, "voyage": 40, "dis": 2.5,
         "loadlist": [4, 0.5]},
        {"id": "b", "x_s": 10, "y_s": 0, "speed": 1, "voyage": 30, "ret": 1, "loadlist": [0, 3]},
    ],
    "targets": [
        {"id": "<b>north</b>", "x": 3, "y": 9, "level": 0.7, "loadlist": [3, 1], "deadline": 20},
        {"id": "south", "x": 6, "y": -4, "level": 1, "loadlist": [1, 2], "service_time": 0.25},
    ],
}  # fmt: skip


_numbers = count(1)


@pytest.fixture
def page(shared_page):
    expect(shared_page.locator("html")).to_have_attribute("data-ready", "true")
    return shared_page


@pytest.fixture
def show(page):
    """Opens a problem by its file, as a user does, under a name that no other had."""

    def shown(problem, suffix="json"):
        content = problem if isinstance(problem, str) else json.dumps(problem)
        name = f"case-{next(_numbers)}"
        page.click("#tab-problem")
        page.locator("#import").set_input_files(
            {"name": f"{name}.{suffix}", "mimeType": "text/plain", "buffer": content.encode()}
        )
        expect(page.locator("#problem-title")).to_contain_text(name)
        return name

    return shown


def exported(page, kind):
    with page.expect_download() as saved:
        page.click(f"[data-export={kind}]")
    return saved.value.path().read_text(encoding="utf-8")


def test_each_example_is_one_click_away(page, service):
    for example in httpx.get(f"{service.url}/examples").json()["examples"]:
        page.click(f"[data-example='{example['name']}']")
        problem = httpx.get(service.url + example["href"]).json()
        expect(page.locator(".symbol.targets")).to_have_count(len(problem["targets"]))
        waiting = page.locator(".symbol .count").all_inner_texts()
        assert page.locator(".symbol.uavs").count() + sum(map(int, waiting)) == len(problem["uavs"])
        first = problem["targets"][0]
        row = page.locator("table[data-kind=targets] tbody tr").first
        assert [row.locator("td").nth(0).inner_text(), float(row.locator("td").nth(3).inner_text())] == [
            first["id"],
            first["level"],
        ]


@pytest.mark.parametrize("kind", ["JSON", "CSV", "GeoJSON"])
def test_files_come_back_without_loss(page, show, kind):
    show(LOCAL)
    text = exported(page, kind)
    show(text, kind.lower())

    assert json.loads(exported(page, "JSON")) == LOCAL


def test_a_file_that_cannot_be_read_is_refused_with_its_line(page, show):
    name = show(LOCAL)
    page.locator("#import").set_input_files(
        {"name": "bad.csv", "mimeType": "text/csv", "buffer": b"kind,id,x_s\nuav,a,zero\n"}
    )
    expect(page.locator(".notice.error")).to_contain_text("line 2: `x_s` is no number: zero")
    expect(page.locator("#problem-title")).to_contain_text(name)


def test_the_table_is_edited_from_the_keyboard_and_undone(page, show):
    show(LOCAL)
    cell = page.locator("table[data-kind=targets] tr[data-id=south] td[data-column=level]")
    cell.click()
    cell.press("ArrowLeft")
    page.keyboard.press("ArrowRight")
    page.keyboard.type("0.25")
    page.keyboard.press("Enter")
    assert json.loads(exported(page, "JSON"))["targets"][1]["level"] == 0.25
    page.locator("body").press("Control+z")
    assert json.loads(exported(page, "JSON")) == LOCAL
    page.locator("body").press("Control+Shift+z")
    assert json.loads(exported(page, "JSON"))["targets"][1]["level"] == 0.25


def test_placing_moving_and_deleting_by_hand(page, show):
    show(LOCAL)
    page.click("[data-place=targets]")
    page.locator("#map").click(position={"x": 200, "y": 150})
    page.keyboard.press("Escape")
    added = json.loads(exported(page, "JSON"))["targets"]
    assert [target["id"] for target in added] == ["<b>north</b>", "south", "area-3"]

    symbol = page.locator(".symbol[data-id=area-3]")
    at = symbol.bounding_box()
    page.mouse.move(at["x"] + at["width"] / 2, at["y"] + at["height"] / 2)
    page.mouse.down()
    page.mouse.move(at["x"] + 90, at["y"] + 10, steps=5)
    page.mouse.up()
    moved = json.loads(exported(page, "JSON"))["targets"][2]
    assert moved["x"] > added[2]["x"]

    page.locator("#map").focus()
    page.keyboard.press("Alt+ArrowLeft")
    assert json.loads(exported(page, "JSON"))["targets"][2]["x"] < moved["x"]
    page.locator("#map").focus()
    page.keyboard.press("Delete")
    assert json.loads(exported(page, "JSON"))["targets"] == LOCAL["targets"]


def test_what_is_selected_says_its_state_and_takes_changes(page, show):
    show(LOCAL)
    page.locator('.symbol.uavs[data-id^="a,"]').click()
    card = page.locator("#view-problem .card")
    expect(card).to_contain_text("in the air, range left 37.5 of 40")
    card.locator("input[name=voyage]").fill("50")
    card.locator("input[name=voyage]").press("Tab")
    expect(card).to_contain_text("range left 47.5 of 50")


def test_returning_is_a_box_and_what_is_of_a_flight_is_there_once_a_uav_has_left(page, show):
    waiting = [{**LOCAL["uavs"][1], "ret": 0}]
    show({**LOCAL, "uavs": waiting})
    page.click("[data-table=uavs]")
    heads = page.locator("table[data-kind=uavs] thead")
    expect(heads).not_to_contain_text("now x")
    row = page.locator("table[data-kind=uavs] tr[data-id=b]")
    row.locator("td[data-column=ret]").click()
    page.keyboard.press("Enter")
    expect(row.locator("td[data-column=ret]")).to_have_text("✓")
    assert json.loads(exported(page, "JSON"))["uavs"][0]["ret"] == 1
    box = page.locator("#view-problem .card input[name=ret]")
    expect(box).to_be_checked()
    box.uncheck()
    expect(row.locator("td[data-column=ret]")).to_have_text("")
    assert "ret" not in json.loads(exported(page, "JSON"))["uavs"][0]

    flight = page.locator("#view-problem .card [data-part=flight]")
    expect(flight.locator("input[name=dis]")).to_be_hidden()
    flight.locator("summary").click()
    flight.locator("input[name=dis]").fill("2")
    flight.locator("input[name=dis]").press("Enter")
    expect(heads).to_contain_text("now x")
    expect(flight.locator("input[name=dis]")).to_be_visible()
    assert json.loads(exported(page, "JSON"))["uavs"][0]["dis"] == 2


def test_names_from_files_never_become_markup(page, show):
    show(LOCAL)
    page.locator(".symbol.targets").first.click()
    expect(page.locator("#view-problem .card h2")).to_have_text("<b>north</b>")


def test_everything_that_takes_input_has_a_name(page, show):
    show(LOCAL)
    page.locator(".symbol.targets").first.click()
    for view in ("problem", "allocate"):
        page.click(f"#tab-{view}")
        page.wait_for_selector(f"#view-{view} select", state="attached")
        nameless = page.evaluate(
            """() => [...document.querySelectorAll('input:not([hidden]), select, button')]
                .filter((each) => !(each.labels?.length || each.textContent.trim() || each.ariaLabel))
                .map((each) => each.outerHTML)"""
        )
        assert nameless == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_stands_out(page, scheme):
    page.emulate_media(color_scheme=scheme)
    ratios = page.evaluate(
        """() => {
            const style = getComputedStyle(document.documentElement);
            const light = (name) => {
                const channels = style.getPropertyValue(name).trim().slice(1).match(/../g)
                    .map((two) => parseInt(two, 16) / 255)
                    .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
                return 0.2126 * channels[0] + 0.7152 * channels[1] + 0.0722 * channels[2];
            };
            const pairs = [['--ink', '--surface'], ['--muted', '--surface'], ['--muted', '--raised'],
                ['--muted', '--map'], ['--danger', '--danger-soft'], ['--accent-ink', '--accent'],
                ['--muted', '--accent-soft']];
            return pairs.map((pair) => {
                const [low, high] = pair.map(light).sort((a, b) => a - b);
                return [pair.join(' on '), (high + 0.05) / (low + 0.05)];
            });
        }"""
    )
    page.emulate_media(color_scheme="light")
    assert {pair: ratio for pair, ratio in ratios if ratio < 4.5} == {}


def test_a_tablet_shows_all_without_scrolling_sideways(page, show):
    page.set_viewport_size({"width": 820, "height": 1180})
    show(LOCAL)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    for element in ("#map", "#panel", "#dock", "#tab-allocate"):
        assert page.locator(element).is_visible()
