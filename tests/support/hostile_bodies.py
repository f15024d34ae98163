"""Bodies that cost a careless server seconds and gigabytes: by kind, in any size."""

from __future__ import annotations

from collections.abc import Iterator

AREAS = '"targets":[{"x":0,"y":0,"level":1,"loadlist":[1]}]'
UAV = '{"x_s":0,"y_s":0,"speed":1,"voyage":1,"loadlist":['

_IN_UAVS = ("{" + AREAS + ',"uavs":[', "]}")
_IN_LOADLIST = ("{" + AREAS + ',"uavs":[' + UAV, "]}]}")


def hostile_bodies(size: int) -> Iterator[tuple[str, bytes]]:
    """Yield kinds and bodies of about so many bytes, none of which is a request of any route."""
    for kind, piece in (
        ("objects", "{}"),
        ("lists", "[]"),
        ("numbers", "-1"),
        ("objects of one name", '{"":0}'),
        ("objects in objects", '{"a":{}}'),
        ("texts", '"ab"'),
        ("objects of 90 unknown names", _names(90)),
        ("lists of numbers", "[1,1,1,1,1,1,1,1]"),
        ("sound UAVs", UAV + "1]}"),
    ):
        yield f"{kind} for UAVs", _many(size, piece, *_IN_UAVS)
    for kind, piece in (("numbers", "-1"), ("lists", "[]"), ("sound amounts", "1")):
        yield f"{kind} for amounts", _many(size, piece, *_IN_LOADLIST)
    yield "UAVs of 64 wrong amounts", _many(size, "-1," * 63 + "-1", *_IN_LOADLIST, "]}," + UAV)
    yield "problems that are objects", _many(size, "{}", '{"problems":[', "]}")
    yield (
        "problems of 900 UAVs that are objects",
        _many(size, "{}," * 899 + "{}", '{"problems":[{"uavs":[', "]}]}", ']},{"uavs":['),
    )
    yield (
        "problems of 900 UAVs that are numbers",
        _many(size, "-1," * 899 + "-1", '{"problems":[{"uavs":[', "]}]}", ']},{"uavs":['),
    )
    yield "tasks", _many(size, "{}", '{"task":{' + AREAS + ',"uavs":[', "]}}")
    many = size // 12
    yield "unknown fields", ("{" + AREAS + "," + _names(many)[1:]).encode()
    sound = '"uavs":[' + UAV + "1]}]"
    yield (
        "unknown parameters",
        ("{" + AREAS + "," + sound + ',"algorithm":"ga","parameters":' + _names(many) + "}").encode(),
    )
    yield "nested lists", b"[" * (size // 2) + b"]" * (size // 2)
    yield "nested objects", b'{"a":' * (size // 5)
    yield "an endless id", ("{" + AREAS + ',"uavs":[{"id":"' + "x" * size + '"}]}').encode()
    yield "an id of escapes", ("{" + AREAS + ',"uavs":[{"id":"' + "\\n" * (size // 2) + '"}]}').encode()
    yield "an endless name", ("{" + AREAS + ',"' + "x" * size + '":1}').encode()
    yield "an endless integer", ("{" + AREAS + ',"seed":' + "1" * size + "}").encode()
    yield "a list without end", b"[" + b"1," * (size // 2)
    yield "spaces", b" " * size


def _many(size: int, piece: str, before: str, after: str, between: str = ",") -> bytes:
    count = max(1, (size - len(before) - len(after)) // (len(piece) + len(between)))
    return (before + between.join([piece] * count) + after).encode()


def _names(count: int) -> str:
    return "{" + ",".join(f'"f{number}":0' for number in range(count)) + "}"
