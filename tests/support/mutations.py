"""Bodies that are nearly right, or not at all: every one from its own seed, so that it can be sent again."""

from __future__ import annotations

import copy
import gzip
import json
import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from app.api.openapi_examples import example_problem

JSON_TYPE = "application/json"

_SCALARS: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 1.5, -0.0, 1e-320, 1e13, -1e13, 1e308, 2**31, 2**53, 2**63, 2**64, 10**40),
    *(
        "",
        "0",
        "x",
        "\x00",
        "\ud800",
        "\udfff\ud800",
        "uav-1",
        "𝔘" * 200,
        "a" * 5000,
        "../../etc/passwd",
        "NaN",
    ),
    *("transfer_qmix", "' OR 1=1 --", "<script>", "\r\nX: y", "\u202e", "local", "wgs84"),
)
_LITERALS = (
    "NaN",
    "Infinity",
    "-Infinity",
    "1e999",
    "-1e999",
    "9" * 400,
    "9" * 5000,
    "01",
    "+1",
    ".5",
    "0x1F",
)
_BROKEN_LITERALS = (
    "",
    "nul",
    "tru",
    "'x'",
    "undefined",
    "1,,2",
    "{",
    "]",
    "\\u12",
    '"\\uD8"',
    '"\t"',
    "//",
    "1e",
)
_DEEP = tuple(a * n + "1" + z * n for a, z in ("[]", ('{"a":', "}")) for n in (2, 50, 400, 980, 3000, 50_000))
_HOLE = "\ue000hole\ue000"
_BOUNDS = frozenset({"time_limit_s", "n_epochs", "iteration", "num_total", "moves"})
"""Fields that keep the work short."""

_CONTENT_TYPES = (
    *(
        "text/plain",
        "application/xml",
        "application/x-www-form-urlencoded",
        "multipart/form-data",
        "",
        "json",
    ),
    *("application/json; charset=utf-16", "application/problem+json", "APPLICATION/JSON", "a/b/c", "\x7f"),
)


@dataclass(frozen=True)
class Sent:
    """A request: where to, the bytes, and the headers beside those of every request."""

    path: str
    body: bytes
    headers: dict[str, str] = field(default_factory=dict)


def sound_bodies() -> dict[str, list[dict[str, Any]]]:
    """Return bodies by the path that takes them; their work is done in milliseconds."""
    task = example_problem("paper-5x10")
    task.pop("algorithm", None)
    limits = {"time_limit_s": 0.02, "seed": 7}
    small = {**task, "uavs": task["uavs"][:2], "targets": task["targets"][:3]}
    short = {"mode": "paper", "n_epochs": 2, "buffer_size": 2, "batch_size": 2}
    return {
        "/allocate": [
            {**task, **limits, "algorithm": "greedy", "parameters": {}},
            {**task, **limits, "algorithm": "ga", "parameters": {"num_total": 4, "iteration": 2}},
            {**task, **limits, "algorithm": "local_search", "parameters": {"moves": 100}},
            {**small, **limits, "algorithm": "qmix", "parameters": short},
            {**task, **limits, "parameters": {"n_epochs": 0, "samples": 0, "polish": False}},
            {**small, **limits, "algorithm": "greedy", "crs": "wgs84", "objective": {"charge_return": True}},
        ],
        "/library": [
            {"name": "mutant", "task": small, "train": {"algorithm": "qmix", "parameters": short, "seed": 1}},
            {"name": "mutant", "task": small, "checkpoint": "AgAAAAAAAAB7fQ=="},
            {"name": "mutant", "job_id": "0" * 32},
        ],
        "/library/similar": [{"task": task, "k": 3}, {"task": small, "k": 1, "similarity": "paper"}],
    }


def mutant(seed: int, number: int, paths: Sequence[str], sound: Mapping[str, Sequence[Any]]) -> Sent:
    """Make one request; the same for the same seed, number, paths and :func:`sound_bodies`."""
    rng = random.Random(f"{seed}/{number}")
    path = paths[number % len(paths)]
    body = copy.deepcopy(rng.choice(sound.get(path) or sound["/allocate"]))
    headers = {"Content-Type": JSON_TYPE, **_headers(rng)}
    gentle = rng.random() < 0.25
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        body = _tuned(rng, body) if gentle else _rebuilt(rng, body)
    text = json.dumps(body)
    if _HOLE_TEXT in text:
        literals = rng.choice((_LITERALS, _LITERALS, _DEEP, _BROKEN_LITERALS))
        # A list of holes may be long: with all of them filled it would be hundreds of megabytes.
        text = text.replace(_HOLE_TEXT, rng.choice(literals), 100)
    if rng.random() < 0.05:
        text = _with_name_twice(rng, text)
    raw = text.encode()
    if rng.random() < 0.2:
        raw, changed = _spoilt(rng, raw)
        headers |= changed
    return Sent(path, raw, {name: value for name, value in headers.items() if value})


_HOLE_TEXT = json.dumps(_HOLE)

_LONGEST = 20_000_000
"""Letters that a repeated value takes at most; the service takes bodies of 8 MiB."""


def _places(value: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    yield at
    if isinstance(value, dict):
        for name, part in value.items():
            yield from _places(part, (*at, name))
    elif isinstance(value, list):
        for index, part in enumerate(value[:12]):
            yield from _places(part, (*at, index))


def _rebuilt(rng: random.Random, body: Any) -> Any:
    """Return the body with one place of its structure changed."""
    *parents, last = rng.choice([at for at in _places(body) if at] or [(None,)])
    if last is None:
        return rng.choice(_SCALARS)
    place = _at(body, parents)
    old = place[last]
    match rng.randrange(12):
        case 0 | 1 | 2:
            place[last] = rng.choice(_SCALARS)
        case 3:
            place[last] = _HOLE
        case 4:
            del place[last]
        case 5:
            place[last] = rng.choice(([old], {"value": old}, [], {}, [[]], [old, None], {"": old}))
        case 6:
            _extend(rng, place, old)
        case 7:
            place[last] = [_HOLE]
        case 8:
            place[last] = _repeated(rng, [old], (2, 65, 1001, 2001))
        case 9 if isinstance(old, list) and old:
            place[last] = _repeated(rng, old, (2, 13, 101))
        case 10 if _is_number(old):
            place[last] = rng.choice(
                (-old, old * 1e12, old / 1e12, str(old), old + 0.5, int(old), float(old))
            )
        case _:
            return {**body, rng.choice(("", "uavs ", "UAVS", "\ud800", "__proto__", "a/b~c")): old}
    return body


def _repeated(rng: random.Random, parts: list[Any], counts: Sequence[int]) -> list[Any]:
    """Repeat a list; only twice where it would become too long. Nothing is shared among the copies."""
    count = rng.choice(counts)
    if count * len(json.dumps(parts)) > _LONGEST:
        count = 2
    return [copy.deepcopy(part) for _ in range(count) for part in parts]


def _extend(rng: random.Random, place: Any, old: Any) -> None:
    if isinstance(place, dict):
        place[rng.choice(("surprise", "", "\ud83d", "id", "\x00", "a~b/c", "x" * 300))] = old
    else:
        place.insert(rng.randrange(len(place) + 1), rng.choice((old, None, {}, "x", 7)))


def _tuned(rng: random.Random, body: Any) -> Any:
    """Return the body with one number changed to another that may well be sound."""
    numbers = [at for at in _places(body) if at and _is_number(_at(body, at)) and at[-1] not in _BOUNDS]
    if numbers:
        *parents, last = rng.choice(numbers)
        place = _at(body, parents)
        place[last] = rng.choice((0, 1, 2 * place[last], place[last] / 3, float(place[last]), rng.random()))
    return body


def _at(body: Any, steps: Sequence[Any]) -> Any:
    for step in steps:
        body = body[step]
    return body


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _with_name_twice(rng: random.Random, text: str) -> str:
    at = rng.choice([place for place, letter in enumerate(text) if letter == "{"] or [0])
    return text[: at + 1] + '"twice": 1, "twice": 2, ' + text[at + 1 :]


def _spoilt(rng: random.Random, raw: bytes) -> tuple[bytes, dict[str, str]]:
    """Return other bytes, or the same under a wrong label."""
    match rng.randrange(10):
        case 0:
            return raw[: rng.randrange(len(raw) + 1)], {}
        case 1:
            spoilt = bytearray(raw)
            for _ in range(rng.choice((1, 3, 30))):
                spoilt[rng.randrange(len(spoilt))] = rng.randrange(256)
            return bytes(spoilt), {}
        case 2:
            return rng.randbytes(rng.choice((0, 1, 7, 1000))), {}
        case 3:
            return b"[" * rng.choice((1000, 100_000)), {}
        case 4:
            return raw.decode().encode(rng.choice(("utf-16", "utf-32", "utf-8-sig"))), {}
        case 5:
            return gzip.compress(raw), {"Content-Encoding": "gzip"}
        case 6:
            return raw, {"Content-Type": rng.choice(_CONTENT_TYPES)}
        case 7:
            return raw + rng.choice((b"}", b" {}", b"\x00", b",", b"\xff")), {}
        case 8 if rng.random() < 0.02:
            return raw + b" " * 8 * 1024**2, {}
        case _:
            at = rng.randrange(len(raw))
            return raw[:at] + raw[at + rng.randrange(1, 20) :], {}


def _headers(rng: random.Random) -> dict[str, str]:
    """Return headers that bound the waiting, some of them odd."""
    prefer = rng.choice(("respond-async", "wait=2", "wait=2, handling=lenient"))
    headers = {"Prefer": prefer}
    if rng.random() < 0.1:
        headers["Idempotency-Key"] = rng.choice(("k", "k" * 255, "k" * 256, "ÿ", "\t", f"{rng.random()}"))
    if rng.random() < 0.05:
        headers["X-Request-ID"] = rng.choice(("id-1", "x" * 129, "a b", "%00", "ÿ"))
    return headers
