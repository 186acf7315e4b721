"""Whatever goes wrong ends in one clear error, or in nothing at all.

``make faults`` tries all of them, which takes minutes, and lists them in ``runs/faults.md``.
"""

import pytest

from robots import RobotLayoutsError
from tests.faults.areas import all_faults
from tests.faults.fault import GOES_ON, REFUSED

FAULTS = list(all_faults())


@pytest.mark.fault
def test_no_fault_is_listed_twice():
    names = [(fault.area, fault.what) for fault in FAULTS]
    assert len(set(names)) == len(names)


@pytest.mark.fault
@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: f"{fault.area}: {fault.what}")
def test_fault(fault, tmp_path, record_property):
    record_property("fault", (fault.area, fault.what, fault.promise))
    if fault.promise == REFUSED:
        with pytest.raises(RobotLayoutsError) as caught:
            fault.run(tmp_path)
        message = str(caught.value)
        assert message, "the error says nothing"
        happened = message.replace(str(tmp_path), "…")
    else:
        assert fault.promise == GOES_ON
        happened = fault.run(tmp_path) or "as if nothing had happened"
    record_property("happened", happened)
