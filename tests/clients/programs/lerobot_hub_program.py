"""LeRobot's EnvHub: our env.py from a repository of a hub, which is a server of this machine."""

import hashlib
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import numpy as np
from lerobot_commands import command, evaluated, successes

ROOT = Path(__file__).parents[3]
ENV = ROOT / "integrations" / "lerobot_env_robot_layouts" / "env.py"
REPOSITORY, COMMIT = "somebody/two-arms", "0" * 39 + "1"
TASK = "TwoRobotPickCube-v1"
WORDS = (
    "--policy.type=act", "--policy.device=cpu", "--policy.pretrained_backbone_weights=null",
    "--env.type=robot_layouts", f"--env.hub_path={REPOSITORY}", f"--env.task={TASK}",
    "--env.render_mode=null", "--env.max_episode_steps=5",
    "--eval.n_episodes=2", "--eval.batch_size=2",
)  # fmt: skip


class Hub(BaseHTTPRequestHandler):
    """Serves one file of one repository, as the hub answers its clients."""

    def do_HEAD(self) -> None:
        """Describe the file."""
        self._answer()

    def do_GET(self) -> None:
        """Send the file."""
        if self._answer():
            self.wfile.write(ENV.read_bytes())

    def _answer(self) -> bool:
        known = self.path == f"/{REPOSITORY}/resolve/main/env.py"
        known |= self.path == f"/{REPOSITORY}/resolve/{COMMIT}/env.py"
        self.send_response(200 if known else 404)
        if known:
            self.send_header("X-Repo-Commit", COMMIT)
            self.send_header("ETag", f'"{hashlib.sha1(ENV.read_bytes()).hexdigest()}"')
            self.send_header("Content-Length", str(ENV.stat().st_size))
        self.end_headers()
        return known

    def log_message(self, *args: object) -> None:
        """Say nothing."""


@contextmanager
def hub() -> Iterator[str]:
    server = ThreadingHTTPServer(("127.0.0.1", 0), Hub)
    Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()


def python_loads_it(folder: Path) -> None:
    from lerobot.envs import close_envs, make_env

    made = make_env(
        REPOSITORY, n_envs=2, use_async_envs=True, hub_cache_dir=str(folder), trust_remote_code=True
    )
    vector = made[TASK][0]
    observation, _ = vector.reset(seed=[0, 1], options={"lerobot_new_rollout": True})
    assert {*observation["pixels"]} == {"base_camera", "left.hand_camera", "right.hand_camera"}
    assert all(seen.dtype == np.uint8 for seen in observation["pixels"].values())
    assert observation["agent_pos"].shape == (2, 18)
    assert vector.call("task_description")[0].startswith("Hand a cube over")
    vector.step(np.zeros((2, 16), np.float32))
    close_envs(made)


def commands_load_it(folder: Path, endpoint: str) -> None:
    variables = {"HF_ENDPOINT": endpoint, "HF_HUB_OFFLINE": "0", "HF_HOME": str(folder / "home")}
    refused = command(
        "lerobot-eval", *WORDS, f"--output_dir={folder / 'refused'}", fails=True, **variables
    )
    assert "Refusing to execute remote code" in refused
    assert not (folder / "home" / "hub").exists()
    reported = evaluated(folder / "trusted", *WORDS, "--trust_remote_code=true", **variables)
    assert successes(reported, TASK) == [False, False]
    assert list((folder / "home" / "hub").rglob("env.py")), "it did not come from the hub"


def main(folder: Path) -> None:
    with hub() as endpoint:
        os.environ["HF_ENDPOINT"] = endpoint
        python_loads_it(folder / "cache")
        commands_load_it(folder, endpoint)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
