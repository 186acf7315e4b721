"""Exported cells, read by MuJoCo, usd-core, Pinocchio, Drake and SAPIEN themselves."""

import sys
from pathlib import Path

import numpy as np
import pytest

from layouts.export.cell import ExportedCell
from tests.clients.environments import new_environment, play
from tests.layouts.travelling import cells, draws

HERE = Path(__file__).parent
PROGRAMS = ("drake", "mujoco", "pinocchio", "usd")
SINGLE = 1e-6  # of the distance from the origin, or m within 1 m; SAPIEN has single precision

pytestmark = [
    pytest.mark.long,
    pytest.mark.xdist_group("export_programs"),  # they share one environment
]


@pytest.fixture(scope="module")
def python(tmp_path_factory):
    if sys.version_info < (3, 11):
        pytest.skip("the newest versions of the other programs need Python 3.11")
    folder = tmp_path_factory.mktemp("programs") / "environment"
    return new_environment(folder, HERE / "programs" / "requirements.txt")


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_program_reads_every_cell(program, python, tmp_path):
    play(python, HERE / "programs" / f"{program}_program.py", tmp_path / "out")


def test_every_program_is_run():
    found = {path.name for path in (HERE / "programs").glob("*_program.py")}
    assert found == {f"{program}_program.py" for program in PROGRAMS}


@pytest.mark.parametrize("name", ["mixed", "table", "hung_pr2", "hung_mobile_panda_dual", "mix_0"])
def test_sapien_reads_a_merged_urdf(name, tmp_path):
    import sapien
    from sapien.wrapper.urdf_loader import URDFLoader

    layout = cells([name])[name]
    urdf = layout.to_urdf(tmp_path / "cell.urdf", visuals=False)
    urdf.with_suffix(".srdf").unlink(missing_ok=True)  # SAPIEN refuses one of more than 31 pairs
    loader = URDFLoader()
    loader.fix_root_link = True
    loader.set_scene(sapien.Scene([sapien.physx.PhysxCpuSystem()]))
    robot = loader.load(str(urdf), package_dir=str(tmp_path))
    cell = ExportedCell.read(layout, visuals=False)
    links = {link.name: link for link in robot.links}
    for positions, poses in draws(cell):
        by_name = {f"{place}/{joint}": value for (place, joint), value in positions.items()}
        robot.set_qpos([by_name[joint.name] for joint in robot.active_joints])
        for (place, link), pose in poses.items():
            found, expected = links[f"{place}/{link}"].entity_pose.p, pose[:3, 3]
            far = max(1.0, float(np.linalg.norm(expected)))
            np.testing.assert_allclose(found, expected, rtol=0, atol=SINGLE * far)
