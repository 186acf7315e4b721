"""Files that someone else put in place are read whole, bounded, and without waiting."""

import errno
import os
import pickle
import socket

import pytest

from robot_layouts.core.files import (
    MAX_JSON_DEPTH,
    open_regular,
    parse_json,
    read_json,
    read_regular,
    read_text,
)
from robots import UnreadableFileError


def test_a_regular_file_is_read_whole_up_to_its_limit(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"12345")
    assert read_regular(path, 5) == b"12345"
    with open_regular(path) as file:
        assert file.read() == b"12345"
    with pytest.raises(UnreadableFileError, match="it has more than 4 bytes"):
        read_regular(path, 4)


def test_a_link_to_a_regular_file_is_followed(tmp_path):
    (tmp_path / "a").write_bytes(b"1")
    (tmp_path / "b").symlink_to("a")
    assert read_regular(tmp_path / "b", 9) == b"1"


def _fifo(path):
    os.mkfifo(path)


def _socket(path):
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(path.name)


@pytest.mark.parametrize(
    ("put", "kind"),
    [
        (_fifo, "a FIFO"),
        (_socket, "a socket"),
        (lambda path: path.mkdir(), "a directory"),
        (lambda path: path.symlink_to("/dev/zero"), "a character device"),
    ],
    ids=["fifo", "socket", "directory", "device"],
)
def test_what_is_not_a_regular_file_is_refused_at_once(tmp_path, monkeypatch, put, kind):
    monkeypatch.chdir(tmp_path)
    put(tmp_path / "a")
    with pytest.raises(UnreadableFileError, match=f"it is {kind}, not a regular file"):
        read_regular("a", 10)


def test_a_file_without_a_size_of_its_own_is_bounded_too():
    with pytest.raises(UnreadableFileError, match="more than 3 bytes"):
        read_regular("/proc/self/status", 3)


def test_what_the_system_refuses_keeps_its_number(tmp_path):
    with pytest.raises(UnreadableFileError, match="cannot read .*gone: No such file") as caught:
        read_regular(tmp_path / "gone", 10)
    assert caught.value.errno == errno.ENOENT
    assert caught.value.strerror == "No such file or directory"
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), again.errno) == (str(caught.value), errno.ENOENT)


def test_a_name_with_a_null_character_is_refused():
    with pytest.raises(UnreadableFileError, match="null"):
        read_regular("a\0b", 10)


def test_text_must_be_utf_8_and_loses_its_byte_order_mark(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"\xef\xbb\xbf{}")
    assert read_text(path, 10) == "{}"
    path.write_bytes(b"ab\xff")
    with pytest.raises(UnreadableFileError, match="it is not UTF-8: invalid start byte, byte 2"):
        read_text(path, 10)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("{", "it is not json"),
        ("", "it is not json"),
        ('{"a": 1, "b": 2, "a": 3}', "the key 'a' is there twice"),
        ("[" * 100_000, "nests deeper"),
        ("[" * 65 + "]" * 65, "nests deeper than 64"),
        ('{"a":' * 70 + "1" + "}" * 70, "nests deeper than 64"),
        ("9" * 5000, "it is not json: .*digits"),
    ],
    ids=["cut", "empty", "twice", "bomb", "deep list", "deep object", "huge number"],
)
def test_json_that_no_one_should_write_is_refused(tmp_path, text, why):
    path = tmp_path / "a.json"
    path.write_text(text)
    with pytest.raises(UnreadableFileError, match=f"cannot read {path}: .*{why}"):
        read_json(path, 10**6)


def test_json_of_ordinary_depth_is_read():
    text = "[" * MAX_JSON_DEPTH + "]" * MAX_JSON_DEPTH
    assert str(parse_json(text)) == text
    assert parse_json('{"a": [1, {"b": null}]}') == {"a": [1, {"b": None}]}
    assert parse_json("3") == 3
