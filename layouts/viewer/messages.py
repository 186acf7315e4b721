"""Which messages of a browser reach viser: those that the controls of a page send."""

from __future__ import annotations

import dataclasses
from typing import Any

MESSAGE_BYTES = 1 << 14  # of the largest that is read; a camera's takes some hundred


def fits(server: Any, data: str | bytes) -> bool:
    """Return whether a message is one that the controls of a page send.

    viser takes much more: requests for a share tunnel, files, values of any type for any attribute
    of a control. Whoever has the token may steer, and nothing else. A page with controls of other
    kinds adds them to `_takes`.

    Args:
        server: The viser server.
        data: What came over the WebSocket.
    """
    from viser import _messages

    try:
        message = _decoded(data, (_messages.ViewerCameraMessage, _messages.GuiUpdateMessage))
    except (ValueError, RecursionError):
        return False
    if isinstance(message, _messages.ViewerCameraMessage):
        return True
    control = server.gui._gui_input_handle_from_uuid.get(message.uuid)
    return set(message.updates) == {"value"} and _takes(control, message.updates["value"])


def _decoded(data: str | bytes, kinds: tuple[type, ...]) -> Any:
    """Decode a message of one of some kinds.

    Raises:
        ValueError: If it is none of them, or its fields are not as they should be.
        RecursionError: If it is nested without end.
    """
    import msgspec

    if isinstance(data, str):
        raise ValueError("viser's messages are bytes")
    fields = msgspec.msgpack.decode(data, type=dict[str, Any])
    called = fields.pop("type", None)
    for kind in kinds:
        if called == kind.__name__ and set(fields) == {f.name for f in dataclasses.fields(kind)}:
            return msgspec.convert(fields, kind)
    raise ValueError(f"no message of kind {called!r} is taken")


def _takes(control: Any, value: Any) -> bool:
    """Return whether a control can be brought to a value by hand."""
    import viser

    match control:
        case viser.GuiSliderHandle():
            low, high = control.min - control.step, control.max + control.step  # rounded to steps
            return type(value) in (int, float) and low <= value <= high
        case viser.GuiCheckboxHandle():
            return isinstance(value, bool)
        case viser.GuiDropdownHandle():
            return value in control.options
        case viser.GuiButtonHandle():
            return value is True
        case _:
            return False
