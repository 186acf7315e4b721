"""``python -m parity render``: native and ours side by side, drawn in native's own scene."""

from __future__ import annotations

import gc
import json
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tqdm import tqdm

import tasks
from parity.episodes import Source
from parity.lockstep import STATE, NativeSide, OurSide, Side, Snapshot, compare, succeeds
from parity.results import as_json
from parity.rollout import find_source
from parity.scene import (
    NativeScene,
    Picture,
    PictureError,
    amplified,
    difference,
    expect_same_shapes,
)
from robot_layouts.core.writing import write_whole
from robot_layouts.data.video import INSTALL, open_video, package_problem
from robots import MissingPackageError, TaskError

NAME = "side_by_side"
# Of 255: mean difference between a state drawn and the same state seen live. Rounding of poses
# takes single pixels over an edge, which came to 0.002 at most; a goal left out, to 0.024 or more.
HONEST = 0.02
SIZES = (192, 1024)  # smallest and largest panel (pixels)
BUFFER, GAIN, SIZE = 10, 8.0, 384
SHEET_ROWS = 6
BACKGROUND, INK = "#1d2126", "#f2f4f6"
HEADER, MARGIN, TEXT = 64, 8, 16  # above the panels, beside and in words (pixels)


def render(
    *,
    task: str,
    demo: Path | None = None,
    seed: int | None = None,
    out: Path = Path("runs"),
    buffer: int = BUFFER,
    gain: float = GAIN,
    size: int = SIZE,
) -> int:
    """Show native | ours | their amplified difference, all drawn in native's own scene.

    Only the physics state differs. Writes side_by_side.mp4, .png (some moments) and .json. Exit
    code: 0 if both sides succeed and nothing differs, 1 if not.

    Args:
        task: Task id.
        demo: Recorded episodes, .h5 (the expert's).
        seed: Reset seed (0); of --demo, the episode with it (its first).
        out: The files go into OUT/TASK.
        buffer: End the clip N frames after the success; -1 shows every step.
        gain: Amplify the difference.
        size: Width of a panel (pixels), a multiple of 16.

    Raises:
        RobotLayoutsError: If it could not be shown.
    """
    smallest, largest = SIZES
    if not smallest <= size <= largest or size % 16:
        raise TaskError(
            f"--size is {size}; it must be a multiple of 16 from {smallest} to {largest}"
        )
    if not 0 < gain <= 255:
        raise TaskError(f"--gain is {gain:g}; it must be above 0, at most 255")
    torch.set_num_threads(1)  # the tensors are small
    cls = tasks.get_task_class(task)
    source, folder = find_source(cls, demo, seed), out / cls.task_id
    with tqdm(unit="frames", desc=cls.task_id, disable=None) as bar:
        clip = make_clip(
            cls.task_id,
            source,
            folder,
            on_frame=lambda share: bar.update(),
            buffer=buffer,
            gain=gain,
            size=size,
        )
    sides = [f"{name} {'yes' if clip[f'{name}_success'] else 'no'}" for name in ("native", "our")]
    print(
        f"{cls.task_id}, seed {clip['seed']}, {clip['source']}: success {', '.join(sides)};"
        f" states differ by up to {clip['max_state_difference']}, {clip['differing_frames']} of"
        f" {clip['frames']} frames differ. Files in {folder}"
    )
    return 0 if is_verified(clip) else 1


def is_verified(clip: dict[str, Any] | None) -> bool:
    """Tell whether a clip shows both sides succeed, and neither a state nor a pixel differs."""
    return clip is not None and (
        clip["native_success"]
        and clip["our_success"]
        and clip["max_state_difference"] == 0
        and clip["differing_frames"] == 0
    )


class Tape:
    """A side that keeps the snapshots which it returns, those of the last episode."""

    def __init__(self, side: Side) -> None:
        """Take a side with one environment."""
        self._side = side
        self.num_envs, self.action_dim = side.num_envs, side.action_dim
        self.snapshots: list[Snapshot] = []

    def reset(self, seeds: Sequence[int], env_ids: Sequence[int], *, rebuild: bool) -> Snapshot:
        """Begin an episode; see `Side`."""
        self.snapshots = [self._side.reset(seeds, env_ids, rebuild=rebuild)]
        return self.snapshots[0]

    def step(self, actions: NDArray[np.float32]) -> Snapshot:
        """Advance the environment; see `Side`."""
        self.snapshots.append(self._side.step(actions))
        return self.snapshots[-1]

    def touching(self) -> NDArray[np.bool_]:
        """Tell whether a robot touched a movable object; see `Side`."""
        return self._side.touching()

    @property
    def success_step(self) -> int | None:
        """First step at which it reported success, or None."""
        return next((step for step, row in enumerate(self.snapshots) if succeeds(row)), None)


def make_clip(
    task_id: str,
    source: Source,
    folder: Path,
    *,
    on_frame: Callable[[float], object] = lambda share: None,
    buffer: int = BUFFER,
    gain: float = GAIN,
    size: int = SIZE,
) -> dict[str, Any]:
    """Play an episode on both sides, draw it, and write the clip, its moments and what was found.

    Args:
        task_id: The task.
        source: What to play, one episode.
        folder: Where the files go; it is made.
        on_frame: Called after every frame with the share of the frames that are drawn.
        buffer: Frames shown after both sides have succeeded; all if negative.
        gain: Factor by which the difference is amplified.
        size: Width and height of each of the three panels (pixels).

    Returns:
        What ``side_by_side.json`` holds: the episode, whether both sides succeeded, and by how much
        states (SI units) and pixels (of 255) differ.

    Raises:
        MissingPackageError: If imageio or pillow is not installed.
        PictureError: If native's scene does not show what is to be seen.
        RobotLayoutsError: If the actions do not fit, or a file cannot be written.
    """
    if (problem := package_problem()) is not None:
        raise MissingPackageError(f"a clip cannot be written: {problem}")
    (episode,), mode = source.episodes, source.control_mode
    with (
        closing(tasks.make(task_id, control_mode=mode)) as env,
        closing(NativeSide(task_id, control_mode=mode, picture_size=size)) as side,
    ):
        native, ours, scene = Tape(side), Tape(OurSide(env)), NativeScene(side.envs[0])
        gc.freeze()  # native collects garbage at each rebuild, in 0.2 s unless frozen
        try:
            (result,), apart = play_and_look(native, ours, source, scene)
        finally:
            gc.unfreeze()
        expect_same_shapes(side.envs[0], env)
        steps = native.success_step, ours.success_step
        shown, deltas, sheet = len(native.snapshots), list[Picture](), list[Picture]()
        if None not in steps and buffer >= 0:
            shown = min(max(step for step in steps if step is not None) + 1 + buffer, shown)
        moments = {int(step) for step in np.linspace(0, shown - 1, SHEET_ROWS).round()}
        with open_video(folder / f"{NAME}.mp4", env.scenario.control_frequency) as append:
            for step in range(shown):
                rows = native.snapshots[step], ours.snapshots[step]
                drawn = scene.draw(rows[0]), scene.draw(rows[1])
                frame, delta = _frame(*drawn, gain, _words(task_id, step, rows))
                append(frame)
                deltas.append(delta)
                if step in moments:
                    sheet.append(frame)
                on_frame((step + 1) / shown)
    found: dict[str, Any] = {
        "task": task_id,
        "seed": episode.seed,
        "source": source.name,
        "steps": result.steps,
        "native_success": steps[0] is not None,
        "our_success": steps[1] is not None,
        "max_state_difference": as_json(max(result.max_difference[part] for part in STATE)),
        "frames": shown,
        "differing_frames": sum(bool(delta.any()) for delta in deltas),
        "mean_pixel_difference": float(np.mean([delta.mean() for delta in deltas])),
        "max_pixel_difference": max(int(delta.max()) for delta in deltas),
        "live_difference": apart,
        "clip": f"{NAME}.mp4",
    }
    _write_png(folder / f"{NAME}.png", np.concatenate(sheet))
    write_whole(folder / f"{NAME}.json", json.dumps(found, indent=1, ensure_ascii=False) + "\n")
    return found


def play_and_look(
    native: Tape, ours: Tape, source: Source, scene: NativeScene
) -> tuple[list[Any], float]:
    """Play an episode and check that drawing native's states shows what native itself shows.

    Native's own picture is taken after the first step, halfway and at the end while it plays, and
    afterwards the states of those steps are drawn as all others will be.

    Returns:
        What the comparison found, and the largest mean difference between such two pictures (of
        255). Only rounding remains there: native computes the links' poses from the joints when a
        state is put in, and physics integrates them.

    Raises:
        PictureError: If the pictures differ by more than rounding.
    """
    (episode,) = source.episodes
    count, live = len(episode.actions), dict[int, Picture]()

    def look(_: int) -> None:
        step = len(native.snapshots) - 1
        if step in (1, (count + 1) // 2, count):
            live[step] = scene.live()

    results = list(compare(native, ours, [episode], on_step=look))
    apart = {
        step: float(difference(scene.draw(native.snapshots[step]), picture).mean())
        for step, picture in live.items()
    }
    worst = max(apart, key=lambda step: apart[step])
    if apart[worst] > HONEST:
        raise PictureError(
            f"native's state of step {worst} looks otherwise drawn than live, by {apart[worst]:.3f}"
            f" of 255 on average (at most {HONEST} is rounding): a part of the picture that is not"
            " in the state dict"
        )
    return results, apart[worst]


def _words(task_id: str, step: int, rows: Sequence[Snapshot]) -> list[str]:
    """Return what stands above native's panel and above ours."""
    return [
        f"{task_id}, step {step}\n{name}"
        + (f", reward {float(row['reward', 'reward'][0]):.4f}" if step else "")
        + (", success" if succeeds(row) else "")
        for name, row in zip(("native", "ours"), rows, strict=True)
    ]


def _frame(
    native: Picture, ours: Picture, gain: float, words: Sequence[str]
) -> tuple[Picture, Picture]:
    """Return native | ours | amplified difference with words above, and the difference as it is.

    The size of the picture is a multiple of 16, as video needs it.
    """
    try:
        from PIL import Image, ImageDraw, ImageFont
    except ImportError as error:
        raise MissingPackageError(f"pictures side by side need pillow: {INSTALL}") from error
    delta, size = difference(native, ours), len(native)
    apart = f"mean {delta.mean():.4f}, largest {delta.max()} of 255" if delta.any() else "none"
    canvas = Image.new("RGB", (3 * size, HEADER + size), BACKGROUND)
    pen, font = ImageDraw.Draw(canvas), ImageFont.load_default(TEXT)
    panels = native, ours, amplified(delta, gain)
    for number, (panel, text) in enumerate(
        zip(panels, (*words, f"difference × {gain:g}:\n{apart}"), strict=True)
    ):
        canvas.paste(Image.fromarray(panel), (number * size, HEADER))
        pen.text((number * size + MARGIN, MARGIN), text, fill=INK, font=font)
    return np.asarray(canvas).copy(), delta


def _write_png(path: Path, picture: Picture) -> None:
    import imageio.v3 as imageio

    write_whole(path, imageio.imwrite("<bytes>", picture, extension=".png"))
