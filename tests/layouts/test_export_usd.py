"""What goes wrong before usd-core is asked; `test_export_programs` has it read whole stages."""

import sys

import pytest

from layouts import single
from robots import MissingPackageError


def test_without_usd_core_it_says_what_brings_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(MissingPackageError, match=r"pip install 'robot-layouts\[usd\]'"):
        single({"arm": "so100"}).to_usd(tmp_path / "cell.usd")
    assert list(tmp_path.iterdir()) == []
