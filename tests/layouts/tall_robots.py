"""Robots whose arms begin high above their wheels."""

import re
from pathlib import Path

from robots import RobotDescriptor, RobotRegistry


def panda_on_a_pillar(folder: Path, height: float) -> RobotDescriptor:
    """Return a Panda, guessed from its file, whose base stands on a pillar (m)."""
    panda = RobotRegistry.load("panda").urdf.locate(pictures=True)
    text = re.sub(r'filename="(?!/)', f'filename="{panda.parent}/', panda.read_text())
    size = f'<geometry><box size="0.3 0.3 {height}"/></geometry>'
    pillar = f"""
  <link name="pillar">
    <inertial>
      <mass value="50"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>
    </inertial>
    <visual><origin xyz="0 0 {height / 2}"/>{size}</visual>
    <collision><origin xyz="0 0 {height / 2}"/>{size}</collision>
  </link>
  <joint name="mount" type="fixed">
    <parent link="pillar"/><child link="panda_link0"/><origin xyz="0 0 {height}"/>
  </joint>
</robot>"""
    path = folder / "panda_on_a_pillar.urdf"
    path.write_text(text.replace("</robot>", pillar))
    return RobotDescriptor.from_urdf(path)
