"""The library: pictures and similarity as the API has them, registering, training while one watches."""

import httpx
import pytest
from dashboard_steps import go, open_problem, ready, show_answer, state, value
from playwright.sync_api import expect

from app.api.openapi_examples import example_problem


def test_source_tasks_are_drawn_and_sorted_by_similarity(page, service):
    ready(page)
    go(page, "library")
    cards = page.locator("article.policy")
    expect(cards.first).to_be_visible()
    body = {"task": state(page, "problem"), "k": 100}
    similar = httpx.post(f"{service.url}/library/similar", json=body).raise_for_status().json()["similar"]

    assert cards.first.get_attribute("data-policy") == similar[0]["policy"]["id"]
    by_id = {each["policy"]["id"]: each for each in similar}
    for card in cards.all()[:6]:
        near = by_id[card.get_attribute("data-policy")]
        assert value(card.locator(".similarity")) == pytest.approx(near["distance"])
        assert card.locator("svg circle").count() == near["policy"]["n_targets"]
        assert card.locator("svg path").count() == near["policy"]["n_uavs"]
    expect(cards.first).to_contain_text("most similar")


def test_policy_of_an_allocation_is_registered_and_deleted(page, service):
    ready(page)
    open_problem(page, example_problem("paper-5x10"), "the paper's")
    go(page, "allocate")
    keeping = page.locator("select[name=keep_checkpoint]")
    page.select_option("select[name=algorithm]", "greedy")
    expect(keeping).to_be_hidden()
    page.select_option("select[name=algorithm]", "transfer_qmix")
    keeping.select_option("true")
    page.fill("input[name=time_limit_s]", "")
    page.locator("#parameters").evaluate("details => { details.open = true; }")
    page.fill("#parameters input[name=n_epochs]", "2")
    page.fill("#parameters input[name=samples]", "0")
    page.select_option("#parameters select[name=polish]", "false")
    page.click("#start")
    page.wait_for_selector("#figures")
    go(page, "library")
    form = page.locator("#view-library form").first
    form.locator("input[name=name]").fill("from the field")

    form.get_by_role("button", name="Register").click()

    card = page.locator("article.policy").filter(has_text="from the field")
    expect(card).to_be_visible()
    policy_id = card.get_attribute("data-policy")
    stored = httpx.get(f"{service.url}/library/{policy_id}").json()
    assert stored["name"] == "from the field"
    assert len(stored["task"]["targets"]) == card.locator("svg circle").count() == 10
    page.on("dialog", lambda dialog: dialog.accept())
    card.get_by_role("button", name="Delete").click()
    expect(card).to_have_count(0)
    assert httpx.get(f"{service.url}/library/{policy_id}").status_code == 404


def test_training_is_watched_to_its_end(page, service):
    ready(page)
    open_problem(page, example_problem("paper-5x10"), "the paper's")
    go(page, "library")
    form = page.locator("#view-library form").nth(1)
    form.locator("input[name=name]").fill("trained here")
    form.locator("input[name=n_epochs]").fill("40")

    form.get_by_role("button", name="Train").click()

    status = page.get_by_test_id("training-status")
    expect(status).to_contain_text("Trained: trained here is in the library as ")
    policy_id = status.inner_text().removesuffix(".").rpartition(" ")[2]
    assert httpx.get(f"{service.url}/library/{policy_id}").json()["name"] == "trained here"
    expect(form.locator("canvas")).to_have_count(1)
    expect(page.locator(f"article.policy[data-policy='{policy_id}']")).to_be_visible()
    httpx.delete(f"{service.url}/library/{policy_id}").raise_for_status()


def test_allocation_that_learned_nothing_cannot_be_registered(page, service):
    ready(page)
    show_answer(page, service.url, algorithm="greedy")
    go(page, "library")

    expect(page.locator("#view-library form").first.get_by_role("button", name="Register")).to_be_disabled()
    expect(page.locator("#view-library form").first).to_contain_text("greedy learns nothing")
