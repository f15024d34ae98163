"""The MCP server between an assistant's client, the SDK's own, and the real service."""

import asyncio
import os
import socket
import subprocess
import sys
import threading
import time
from contextlib import asynccontextmanager
from pathlib import Path

import httpx2
import pytest
from mcp import Client
from mcp.client.stdio import StdioServerParameters
from mcp.client.streamable_http import streamable_http_client

ROOT = Path(__file__).parents[2]
COMMAND = ["-m", "app", "mcp"]
TOOLS = {
    "allocate",
    "begin_mission",
    "delete_mission",
    "evaluate",
    "example_problem",
    "explain",
    "list_algorithms",
    "list_missions",
    "look_at_mission",
    "tell_mission",
}
STARTS_WITHIN_S = 120


@pytest.fixture(scope="module")
def http_url(service):
    """The address of a server of streamable HTTP, which has no key of its own."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    arguments = [*COMMAND, "--url", service.url, "--transport", "http", "--port", str(port)]
    with subprocess.Popen([sys.executable, *arguments], cwd=ROOT) as process:
        end = time.monotonic() + STARTS_WITHIN_S
        while not answers(port):
            assert process.poll() is None
            assert time.monotonic() < end
            threading.Event().wait(0.1)
        yield f"http://127.0.0.1:{port}/mcp"
        process.terminate()


def answers(port):
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


@asynccontextmanager
async def over_http(url, key):
    headers = {} if key is None else {"Authorization": f"Bearer {key}"}
    async with (
        httpx2.AsyncClient(headers=headers, timeout=60) as http,
        Client(streamable_http_client(url, http_client=http)) as client,
    ):
        yield client


def over_stdio(service):
    environment = {**os.environ, "UAV_ALLOCATOR_URL": service.url, "UAV_ALLOCATOR_KEY": service.key}
    return Client(StdioServerParameters(command=sys.executable, args=COMMAND, env=environment, cwd=str(ROOT)))


@pytest.fixture(params=["stdio", "http"])
def session(request, service):
    """Opens a session with a key, over one transport and the other."""
    if request.param == "stdio":
        return lambda: over_stdio(service)
    url = request.getfixturevalue("http_url")
    return lambda: over_http(url, service.key)


async def call(client, tool, **arguments):
    answer = await client.call_tool(tool, arguments)
    assert not answer.is_error, answer.content
    return answer.structured_content


def test_an_assistant_plans_judges_explains_and_flies_a_day(session):
    async def talk():
        async with session() as client:
            tools = {each.name: each for each in (await client.list_tools()).tools}
            assert tools.keys() == TOOLS
            speed = tools["allocate"].input_schema["properties"]["request"]["properties"]["uavs"]
            assert speed["items"]["properties"]["speed"]["minimum"] > 0
            problem = await call(client, "example_problem", name="paper-5x10")
            told = []

            async def note(progress, total, message):
                told.append((progress, message))

            request = {**problem, "algorithm": "local_search", "time_limit_s": 1}
            found = await client.call_tool("allocate", {"request": request}, progress_callback=note)
            plan = found.structured_content
            assert any(message and message.startswith("best reward ") for _, message in told)
            judged = await call(
                client, "evaluate", request={**problem, "assignment": plan["assignment"], "at": 0.2}
            )
            assert judged["reward"] == pytest.approx(plan["reward"])
            assert judged["remaining"]["uavs"]
            words = (await call(client, "explain", job_id=plan["job_id"]))["result"]
            assert f"Reward {plan['reward']:g}" in words
            for need in plan["unmet"]:
                assert f"- {need['target_id']}, " in words
                assert need["reason"] in words
            await fly(client, problem)

    asyncio.run(talk())


async def fly(client, problem):
    """Begin a mission, accept the plan that is proposed, and say that time has passed."""
    begun = {"problem": problem, "algorithm": "greedy", "time_limit_s": 5}
    mission = (await call(client, "begin_mission", request=begun))["id"]
    while (standing := await call(client, "look_at_mission", mission_id=mission))["searching"]:
        await asyncio.sleep(0.05)
    (proposal,) = standing["proposals"]
    accepted = {"type": "proposal_accepted", "id": "yes", "proposal": proposal["number"]}
    await call(client, "tell_mission", mission_id=mission, event=accepted)
    told = await call(
        client, "tell_mission", mission_id=mission, event={"type": "clock", "id": "tick", "at": 0.2}
    )
    assert told["effect"]["flyable"] is True
    earlier = await call(client, "look_at_mission", mission_id=mission, at=0.0)
    assert earlier["state"]["clock"] == 0.0
    listed = await call(client, "list_missions")
    assert mission in [each["id"] for each in listed["result"]]
    await call(client, "delete_mission", mission_id=mission)
    gone = await client.call_tool("look_at_mission", {"mission_id": mission})
    assert gone.is_error
    assert "404 mission-not-found" in gone.content[0].text


def test_the_limits_are_the_services(session):
    async def talk():
        async with session() as client:
            problem = await call(client, "example_problem", name="paper-5x10")
            wrong = {**problem, "uavs": [{**problem["uavs"][0], "speed": -5}]}
            refused = await client.call_tool("allocate", {"request": wrong})
            assert refused.is_error
            assert "422 invalid-request: /uavs/0/speed: is -5, must be more than 0" in refused.content[0].text
            many = [{**each, "id": None} for each in problem["uavs"]] * 11
            refused = await client.call_tool("allocate", {"request": {**problem, "uavs": many}})
            assert "problem-too-large: 55 UAVs, at most 50 are taken" in refused.content[0].text
            rows = [[0] * 5, [0] * 5]
            refused = await client.call_tool("evaluate", {"request": {**problem, "assignment": rows}})
            assert "422 illegal-plan: " in refused.content[0].text

    asyncio.run(talk())


@pytest.mark.parametrize("key", [None, "0" * 12 + ".wrong"])
def test_over_http_every_request_brings_its_own_key(http_url, key):
    async def talk():
        async with over_http(http_url, key) as client:
            refused = await client.call_tool("list_missions", {})
            assert refused.is_error
            assert "401 unauthenticated" in refused.content[0].text

    asyncio.run(talk())


def test_a_search_that_is_called_off_ends(service):
    headers = {"Authorization": f"Bearer {service.key}"}

    def running():
        jobs = httpx2.get(f"{service.url}/jobs", params={"limit": 1}, headers=headers).json()["jobs"]
        return jobs[0]["id"] if jobs and jobs[0]["status"] == "running" else None

    async def talk():
        async with over_stdio(service) as client:
            problem = await call(client, "example_problem", name="paper-5x10")
            request = {**problem, "algorithm": "local_search", "time_limit_s": 600}
            asking = asyncio.create_task(client.call_tool("allocate", {"request": request}))
            while (job := await asyncio.to_thread(running)) is None:
                await asyncio.sleep(0.05)
            asking.cancel()
            end = time.monotonic() + 60
            while await asyncio.to_thread(running) == job:
                assert time.monotonic() < end, "it goes on"
                await asyncio.sleep(0.05)

    asyncio.run(talk())


def test_what_is_missing_is_said():
    program = (
        "import sys; sys.modules['mcp'] = None; sys.argv = ['app', 'mcp'];"
        "from app.cli import application; application()"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "the MCP server needs mcp: pip install 'uav-allocator[mcp]'\n"


def test_over_http_the_server_takes_no_key_of_its_own(service):
    arguments = [*COMMAND, "--url", service.url, "--transport", "http", "--key", "k"]
    done = subprocess.run([sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "every request brings its own key" in done.stderr
