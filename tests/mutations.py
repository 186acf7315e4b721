"""Files that were good before somebody damaged them: strategies for hypothesis."""

from __future__ import annotations

import re

from hypothesis import strategies as st

NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:[eE]-?\d+)?")
ODD_VALUES = (
    "", " ", "0", "-1", "1e-300", "1e-20", "1e17", "1e30", "1e300", "nan", "inf", "x", "1 2",
    "0 0 0", "1e9999", "٣", "..", "/", "a\tb", "&#10;", "&#x10FFFF;", "package://", "file:///",
)  # fmt: skip


@st.composite
def damaged_text(draw: st.DrawFn, good: str) -> str:
    """Draw a text with up to four damages: numbers and spans that are changed or repeated."""
    text = good
    for _ in range(draw(st.integers(1, 4))):
        kind = draw(st.sampled_from(["number", "span", "repeat", "cut", "character", "swap"]))
        start = draw(st.integers(0, max(0, len(text) - 1)))
        end = min(len(text), start + draw(st.integers(0, 60)))
        if kind == "number":
            found = list(NUMBER.finditer(text))
            if found:
                match = found[draw(st.integers(0, len(found) - 1))]
                value = draw(st.sampled_from(ODD_VALUES) | st.floats().map(repr))
                text = text[: match.start()] + value + text[match.end() :]
        elif kind == "span":
            text = text[:start] + draw(st.text(max_size=8)) + text[end:]
        elif kind == "repeat":
            text = text[:end] + text[start:end] * draw(st.integers(1, 3)) + text[end:]
        elif kind == "cut":
            text = text[:start] + text[end:]
        elif kind == "character":
            text = text[:start] + draw(st.sampled_from("<>\"'&/=[]{}:,-\0\n ")) + text[start + 1 :]
        else:
            other = draw(st.integers(0, max(0, len(text) - 1)))
            text = text[:start] + text[other : other + end - start] + text[end:]
    return text


@st.composite
def damaged_bytes(draw: st.DrawFn, good: bytes) -> bytes:
    """Draw bytes of which some are overwritten, cut off, repeated or put in."""
    data = bytearray(good)
    for _ in range(draw(st.integers(1, 4))):
        kind = draw(st.sampled_from(["overwrite", "truncate", "insert", "repeat", "number"]))
        start = draw(st.integers(0, max(0, len(data) - 1)))
        if kind == "overwrite":
            new = draw(st.binary(min_size=1, max_size=8))
            data[start : start + len(new)] = new
        elif kind == "truncate":
            del data[start:]
        elif kind == "insert":
            data[start:start] = draw(st.binary(min_size=1, max_size=64))
        elif kind == "repeat":
            data[start:start] = data[start : start + draw(st.integers(1, 200))]
        else:
            data[start : start + 4] = draw(
                st.sampled_from([b"\xff\xff\xff\xff", bytes(4), b"\0\0\xc0\x7f", b"\0\0\0\x80"])
            )
    return bytes(data)
