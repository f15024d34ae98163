import json
import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from safetensors.numpy import load, save

from policy_store.checkpoint import (
    ContainerLimits,
    TensorInfo,
    read_container,
    require_finite,
    require_tensors,
)
from policy_store.errors import InvalidContainer

DTYPES = {
    "F64": np.float64,
    "F32": np.float32,
    "F16": np.float16,
    "I64": np.int64,
    "I32": np.int32,
    "I16": np.int16,
    "I8": np.int8,
    "U8": np.uint8,
}
GOOD = save(
    {"fc.weight": np.ones((3, 2), np.float32), "fc.bias": np.zeros(3, np.float16)}, metadata={"format": "1"}
)


def pack(header: object, data: bytes = b"") -> bytes:
    raw = header if isinstance(header, bytes) else json.dumps(header).encode()
    return len(raw).to_bytes(8, "little") + raw + data


def entry(begin: int = 0, end: int = 4, shape: object = (1,), dtype: object = "F32") -> dict[str, object]:
    return {"dtype": dtype, "shape": shape, "data_offsets": [begin, end]}


tensors = st.dictionaries(
    st.text(st.characters(codec="utf-8"), min_size=1, max_size=8).filter(lambda name: name != "__metadata__"),
    st.tuples(st.lists(st.integers(1, 3), max_size=3), st.sampled_from(sorted(DTYPES))),
    min_size=1,  # safetensors 0.8 writes broken JSON for no tensors with empty metadata
    max_size=6,
)


@given(
    tensors, st.dictionaries(st.text(st.characters(codec="utf-8"), max_size=5), st.text("aé\n", max_size=9))
)
def test_what_safetensors_writes_is_read(shapes, metadata) -> None:
    arrays = {name: np.zeros(shape, DTYPES[dtype]) for name, (shape, dtype) in shapes.items()}
    data = save(arrays, metadata=metadata)
    container = read_container(data)
    assert {n: (list(t.shape), t.dtype) for n, t in container.tensors.items()} == {
        n: (shape, dtype) for n, (shape, dtype) in shapes.items()
    }
    assert container.metadata == metadata
    require_tensors(container, shapes)
    require_finite(data, container)


def test_offsets_point_at_the_numbers() -> None:
    container = read_container(GOOD)
    for name, array in load(GOOD).items():
        info = container.tensors[name]
        place = GOOD[container.data_start + info.begin : container.data_start + info.end]
        assert place == array.tobytes()


@settings(max_examples=400)
@given(st.data())
def test_mutated_files_are_refused_or_still_consistent(data: st.DataObject) -> None:
    mutated = bytearray(GOOD)
    for _ in range(data.draw(st.integers(1, 6))):
        position = data.draw(st.integers(0, len(mutated)))
        change = data.draw(st.sampled_from(["flip", "insert", "delete", "cut"]))
        if change == "flip" and position < len(mutated):
            mutated[position] ^= data.draw(st.integers(1, 255))
        elif change == "insert":
            mutated[position:position] = data.draw(st.binary(max_size=8))
        elif change == "delete":
            del mutated[position : position + data.draw(st.integers(1, 8))]
        else:
            del mutated[position:]
    check_refused_or_consistent(bytes(mutated))


@given(st.binary(max_size=300))
def test_random_bytes_are_refused(data: bytes) -> None:
    check_refused_or_consistent(data)


json_values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=6)
    | st.sampled_from(["F32", "I8"]),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(
            st.sampled_from(["dtype", "shape", "data_offsets", "__metadata__", "w"]) | st.text(max_size=3),
            inner,
            max_size=4,
        )
    ),
    max_leaves=20,
)


@settings(max_examples=400)
@given(json_values, st.binary(max_size=16))
@example({"w": {"dtype": ["F32"], "shape": [1], "data_offsets": [0, 4]}}, b"1234")
@example({"w": {"dtype": "F32", "shape": [True], "data_offsets": [0, 4]}}, b"1234")
def test_any_json_as_header_is_refused_or_consistent(header: object, data: bytes) -> None:
    check_refused_or_consistent(pack(header, data))


def check_refused_or_consistent(data: bytes) -> None:
    try:
        container = read_container(data)
        require_finite(data, container)
    except InvalidContainer as refused:
        str(refused).encode()
        return
    # Whatever was taken must cover the data exactly.
    sizes = [info.end - info.begin for info in container.tensors.values()]
    assert container.data_start + sum(sizes) == len(data)
    for info in container.tensors.values():
        items = math.prod(info.shape)
        assert (
            items * (2 if info.dtype == "BF16" else np.dtype(DTYPES[info.dtype]).itemsize)
            == info.end - info.begin
        )


HUGE = 2**62
REFUSED = {
    "empty": (b"", "too few"),
    "header longer than the file": ((1000).to_bytes(8, "little") + b"{}", "does not fit"),
    "header of 2**64 - 1 bytes": (b"\xff" * 8 + b"{}", "at most 65536"),
    "header over its limit": (pack(b"{" + b" " * 65536 + b"}"), "at most 65536"),
    "a list": (pack([]), "opening brace"),
    "space before the brace": (pack(b" {}"), "opening brace"),
    "rubbish after the object": (pack(b"{}x"), "JSON object"),
    "not UTF-8": (pack(b'{"\xff": 1}'), "JSON object"),
    "nested by the thousand": (pack(b'{"a":' + b"[" * 60000), "JSON object"),
    "an integer of 60,000 digits": (pack(b'{"a":' + b"9" * 60000 + b"}"), "JSON object"),
    "NaN in the header": (pack(b'{"a": NaN}'), "number NaN"),
    "a tensor twice": (
        pack(
            b'{"a":' + json.dumps(entry()).encode() + b',"a":' + json.dumps(entry()).encode() + b"}", b"1234"
        ),
        "name twice",
    ),
    "a key of a tensor twice": (
        pack(b'{"a":{"dtype":"F32","dtype":"F32","shape":[1],"data_offsets":[0,4]}}', b"1234"),
        "name twice",
    ),
    "half a surrogate pair as a name": (pack(b'{"\\ud800": 1}'), "not Unicode"),
    "half a surrogate pair as metadata": (pack(b'{"__metadata__": {"a": "\\ud800"}}'), "not Unicode"),
    "metadata that is no text": (pack({"__metadata__": {"a": 1}}), "'a' is not a string"),
    "metadata that is no object": (pack({"__metadata__": "a"}), "not an object"),
    "an unknown key": (pack({"a": {**entry(), "x": 1}}, b"1234"), "described by"),
    "an unknown type": (pack({"a": entry(dtype="F8_E5M2")}, b"1234"), "no known type"),
    "a type that is no text": (pack({"a": entry(dtype=[])}, b"1234"), "no known type"),
    "elements beyond 64 bits": (pack({"a": entry(0, 0, [HUGE, 4])}), "does not have the 0 bytes"),
    "a huge empty tensor, again": (pack({"a": entry(0, 4, [0, HUGE])}, b"1234"), "does not have the 4 bytes"),
    "true as a length": (pack({"a": entry(shape=[True])}, b"1234"), "no shape"),
    "a fraction as a length": (pack({"a": entry(shape=[1.0])}, b"1234"), "no shape"),
    "a negative length": (pack({"a": entry(shape=[-1, -1])}, b"1234"), "no shape"),
    "too many dimensions": (pack({"a": entry(shape=[1] * 9)}, b"1234"), "at most 8 dimensions"),
    "three offsets": (pack({"a": {**entry(), "data_offsets": [0, 4, 4]}}, b"1234"), "data_offsets"),
    "offsets the wrong way round": (pack({"a": entry(4, 0)}, b"1234"), "-4 bytes"),
    "offsets beyond the data": (pack({"a": entry(4, 8)}, b"1234"), "gap"),
    "an overlap": (pack({"a": entry(0, 4), "b": entry(2, 6)}, b"123456"), "overlaps"),
    "a gap": (pack({"a": entry(0, 4), "b": entry(5, 9)}, b"123456789"), "gap"),
    "data that is no tensor's": (pack({"a": entry()}, b"12345"), "have 4 bytes, its data 5"),
    "too little data": (pack({"a": entry()}, b"123"), "have 4 bytes, its data 3"),
    "1,000 empty tensors": (
        pack({f"{i:x}": {"dtype": "U8", "shape": [0], "data_offsets": [0, 0]} for i in range(1000)}),
        "1000 tensors, at most 512",
    ),
}


@pytest.mark.parametrize(("data", "reason"), REFUSED.values(), ids=REFUSED.keys())
def test_refused_with_its_reason(data: bytes, reason: str) -> None:
    with pytest.raises(InvalidContainer, match=reason):
        read_container(data)


def test_a_file_over_the_limit_is_refused_before_it_is_read() -> None:
    with pytest.raises(InvalidContainer, match=f"{len(GOOD)} bytes, at most 10"):
        read_container(GOOD, ContainerLimits(bytes=10))


EXPECTED = {"fc.weight": ((3, 2), "F32"), "fc.bias": ((3,), "F16")}


def test_the_tensors_of_the_architecture_are_accepted() -> None:
    container = read_container(GOOD)
    require_tensors(container, EXPECTED)
    assert container.tensors["fc.weight"] == TensorInfo((3, 2), "F32", 0, 24)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"gru.weight": ((1,), "F32")}, "'gru.weight' is missing"),
        ({"fc.bias": ((3, 1), "F16")}, r"'fc.bias' is F16 \[3\], not F16 \[3, 1\]"),
        ({"fc.bias": ((3,), "F32")}, r"'fc.bias' is F16 \[3\], not F32 \[3\]"),
        ({f"missing.{i}": ((1,), "F32") for i in range(7)}, r"and 2 more"),
    ],
)
def test_other_tensors_are_refused(change, reason: str) -> None:
    with pytest.raises(InvalidContainer, match=reason):
        require_tensors(read_container(GOOD), EXPECTED | change)


def test_a_tensor_too_many_is_refused() -> None:
    with pytest.raises(InvalidContainer, match=r"'fc\.weight' is not part of the architecture"):
        require_tensors(read_container(GOOD), {"fc.bias": ((3,), "F16")})


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.float16])
def test_numbers_that_are_not_finite_are_refused(value: float, dtype: type) -> None:
    data = save({"a": np.ones(3, dtype), "b": np.array([[1, value], [0, 2]], dtype)})
    with pytest.raises(InvalidContainer, match="'b' has 1 numbers not finite"):
        require_finite(data, read_container(data))


@pytest.mark.parametrize(
    ("bits", "finite"),
    [(0x3F80, True), (0x7F7F, True), (0xFF7F, True), (0x7F80, False), (0xFF80, False), (0x7FC0, False)],
)
def test_bfloat16_is_looked_at_too(bits: int, finite: bool) -> None:
    data = pack({"a": entry(0, 2, [1], "BF16")}, bits.to_bytes(2, "little"))
    container = read_container(data)
    if finite:
        require_finite(data, container)
    else:
        with pytest.raises(InvalidContainer, match="not finite"):
            require_finite(data, container)
