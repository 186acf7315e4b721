"""Writes small MJCFs for tests: an arm of boxes, with what a test adds to it."""

from __future__ import annotations

from pathlib import Path

AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")

JAWS = """
<body name="hand" pos="0.06 0 0">
  <geom type="box" size="0.02 0.05 0.02"/>
  {site}
  <body name="one" pos="0.04 0.01 0">
    <joint name="slide_one" type="slide" axis="0 1 0" range="0 0.04"/>
    <geom type="box" size="0.03 0.005 0.01" pos="0.03 0.005 0"/>
  </body>
  <body name="two" pos="0.04 -0.01 0">
    <joint name="slide_two" type="slide" axis="0 -1 0" range="0 0.04"/>
    <geom type="box" size="0.03 0.005 0.01" pos="0.03 -0.005 0"/>
  </body>
</body>
"""


def arm(name: str = "", end: str = "", at: str = "0 0 0", inside: str = "") -> str:
    """Return the bodies of an arm of six joints that reaches out along x.

    Args:
        name: Put before the names of bodies and joints.
        end: Bodies and sites on its last body.
        at: Where it stands (m).
        inside: What its base holds besides.
    """
    text, close = f'<body name="{name}base" pos="{at}">{inside}', "</body>"
    text += '<geom type="box" size="0.05 0.05 0.04"/>'
    for i, axis in enumerate(AXES, start=1):
        place = "0 0 0.1" if i == 1 else "0.12 0 0"
        text += f'<body name="{name}link{i}" pos="{place}"><joint name="{name}joint{i}"'
        text += f' axis="{axis}" range="-100 100"/>'
        text += '<geom type="box" size="0.04 0.015 0.015" pos="0.06 0 0" density="800"/>'
        close += "</body>"
    return text + end + close


def motors(name: str = "", kind: str = "motor", **fields: object) -> str:
    """Return an actuator for each joint of an `arm`."""
    more = " ".join(f'{key}="{value}"' for key, value in fields.items())
    return "".join(f'<{kind} joint="{name}joint{i}" {more}/>' for i in range(1, len(AXES) + 1))


def mjcf(bodies: str, rest: str = "", model: str = "small") -> str:
    """Return the text of an MJCF with some bodies, and other parts behind them."""
    return f'<mujoco model="{model}"><worldbody>{bodies}</worldbody>{rest}</mujoco>'


def write(folder: Path, text: str, name: str = "arm.xml") -> Path:
    """Write an MJCF, and return its path."""
    path = folder / name
    path.write_text(text, "utf-8")
    return path
