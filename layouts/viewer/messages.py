"""Which messages of a browser reach viser: those that the controls of a page send."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from robot_layouts.core.bounds import UNIT_TOLERANCE

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
    from viser import _messages as kinds

    taken = (
        kinds.ViewerCameraMessage,
        kinds.GuiUpdateMessage,
        kinds.CommandTriggerMessage,
        kinds.TransformControlsDragStartMessage,
        kinds.TransformControlsUpdateMessage,
        kinds.TransformControlsDragEndMessage,
    )
    try:
        message = _decoded(data, taken)
    except (ValueError, RecursionError):
        return False
    match message:
        case kinds.ViewerCameraMessage():
            return True
        case kinds.GuiUpdateMessage():
            control = server.gui._gui_input_handle_from_uuid.get(message.uuid)
            return set(message.updates) == {"value"} and _takes(control, message.updates["value"])
        case kinds.CommandTriggerMessage():
            command = server.gui._command_handle_from_uuid.get(message.uuid)
            return command is not None and not command.disabled
        case _:
            return _drags(server, message)


def _drags(server: Any, message: Any) -> bool:
    """Return whether a message drags a gizmo of the page that is shown to a pose in its reach."""
    gizmo = server.scene._handle_from_transform_controls_name.get(message.name)
    if gizmo is None or not gizmo.visible or message.owner:
        return False
    if not hasattr(message, "position"):  # it only takes the gizmo, or lets go of it
        return True
    limits = zip(gizmo.translation_limits, message.position, strict=True)
    length = math.hypot(*message.wxyz)
    return all(low <= x <= high for (low, high), x in limits) and abs(length - 1) < UNIT_TOLERANCE


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
