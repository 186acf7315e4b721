"""A clip of one episode, native beside ours, with a contact sheet and what was measured."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from parity.compare.both_sides import NativeSide, OurSide
from parity.compare.episodes import Episode
from parity.show.native_pictures import NativeScene, Picture, expect_same_shapes
from parity.show.panels import Labels, contact_sheet, moments, side_by_side
from parity.show.side_by_side import Frame, PixelCount, frames, most_alike, play, play_and_look
from robots import MissingPackageError, RecordingError
from rollouts.video import open_video, package_problem

NAME = "side_by_side"


@dataclass(frozen=True)
class Candidate:
    """An episode that may be shown.

    Attributes:
        episode: What to play.
        source: Where the actions come from, in a few words.
    """

    episode: Episode
    source: str


@dataclass(frozen=True)
class ClipOptions:
    """How a clip is made.

    Attributes:
        buffer: Frames to show after both sides have succeeded; None shows every step.
        gain: Factor by which the difference is amplified.
    """

    buffer: int | None = 10
    gain: float = 8.0


@dataclass(frozen=True)
class SideBySide:
    """What a clip shows; kept as json beside it.

    Attributes:
        task: Task id.
        seed: Reset seed of the episode.
        source: Where the actions come from, in a few words.
        steps: Control steps that both sides played.
        native_success: Whether native reported success at some step.
        our_success: Whether ours did.
        success_step: The step by which both had succeeded, or None.
        max_state_difference: Largest |Δ| of any pose, velocity or joint over all steps (SI units).
        frames: Frames of the clip, the reset's included.
        differing_frames: How many of them differ in any pixel.
        mean_pixel_difference: Mean |Δ| over all pixels and colours of all frames (of 255).
        max_pixel_difference: Largest |Δ| of any (of 255).
        live_difference: Mean |Δ| between native drawn from its state and native's own picture of
            that moment, the largest of three moments (of 255); rounding alone keeps it from 0.
        panel_size: Width and height of a panel (pixels).
        difference_gain: Factor by which the third panel is amplified.
        clip: Name of the mp4 file beside the json.
        sheet: Name of the contact sheet, a png file beside it.
    """

    task: str
    seed: int
    source: str
    steps: int
    native_success: bool
    our_success: bool
    success_step: int | None
    max_state_difference: float
    frames: int
    differing_frames: int
    mean_pixel_difference: float
    max_pixel_difference: int
    live_difference: float
    panel_size: int
    difference_gain: float
    clip: str
    sheet: str

    @property
    def verified(self) -> bool:
        """Whether both sides succeed and neither a state nor a pixel differs."""
        equal = self.max_state_difference == 0 and self.differing_frames == 0
        return self.native_success and self.our_success and equal

    def sentences(self) -> list[str]:
        """Return what was found: success, states, pictures."""
        return [
            _success_text(self),
            f"states: largest difference {self.max_state_difference:.3g} over {self.steps} steps",
            f"pictures: mean difference {self.mean_pixel_difference:.4f} of 255,"
            f" {self.differing_frames} of {self.frames} frames differ",
        ]


def choose(
    native: NativeSide,
    ours: OurSide,
    candidates: Sequence[Candidate],
    buffer: int | None,
    on_step: Callable[[], None] = lambda: None,
) -> Candidate:
    """Return the candidate in which both sides succeed and differ least, the shortest of these.

    Args:
        native: Native with one environment.
        ours: Ours with one environment.
        candidates: At least one.
        buffer: Frames shown after the success.
        on_step: Called after every step.
    """
    played = (play(native, ours, c.episode, lambda _: on_step()) for c in candidates)
    best = most_alike(played, buffer)
    return next(c for c in candidates if c.episode is best.episode)


class Clip:
    """An episode that was played on both sides, ready to be drawn.

    Attributes:
        frames: How many frames it has, the reset's included.
    """

    def __init__(
        self,
        native: NativeSide,
        ours: OurSide,
        candidate: Candidate,
        options: ClipOptions | None = None,
    ) -> None:
        """Play the episode and check that native's scene can show it.

        Args:
            native: Native with one environment and square pictures; its scene draws both sides.
            ours: Ours with one environment.
            candidate: What to play.
            options: How the clip is made.

        Raises:
            PictureError: If the scene does not show what is to be seen.
            TaskError: If the actions do not fit the sides.
        """
        self._task, self._candidate = ours.env, candidate
        self._options = options or ClipOptions()
        self._scene = NativeScene(native.envs[0])
        self._playback, self._live_difference = play_and_look(
            native, ours, candidate.episode, self._scene
        )
        expect_same_shapes(native.envs[0], ours.env)
        self.frames = self._playback.frames(self._options.buffer)

    def write(self, folder: Path, on_frame: Callable[[], None] = lambda: None) -> SideBySide:
        """Draw it and write ``side_by_side.mp4``, ``.png`` and ``.json``, each whole or not at all.

        Args:
            folder: Where to; it must exist.
            on_frame: Called after every frame.

        Raises:
            MissingPackageError: If imageio or pillow is not installed.
            PictureError: If a state cannot be drawn.
            RecordingError: If a file cannot be written.
        """
        if (problem := package_problem()) is not None:
            raise MissingPackageError(f"a clip cannot be written: {problem}")
        pixels, shown = PixelCount(), list[Frame]()
        labels, sheet = self._labels(), moments(self.frames)
        with open_video(folder / f"{NAME}.mp4", self._task.scenario.control_frequency) as append:
            for frame in frames(self._playback, self._scene, self.frames):
                append(side_by_side(frame, labels))
                pixels.add(frame.difference)
                if frame.step in sheet:
                    shown.append(frame)
                on_frame()
        made = self._measured(pixels, len(shown[0].native))
        _write_png(folder / made.sheet, contact_sheet(shown, labels, "; ".join(made.sentences())))
        text = json.dumps(asdict(made), indent=1, ensure_ascii=False) + "\n"
        _write(folder / f"{NAME}.json", text.encode())
        return made

    def _labels(self) -> Labels:
        seed, source = self._candidate.episode.seed, self._candidate.source
        headline = f"{self._task.task_id}, seed {seed}, {source}"
        return Labels(headline, self._options.gain, self.frames - 1)

    def _measured(self, pixels: PixelCount, size: int) -> SideBySide:
        playback = self._playback
        native, ours = playback.success_steps
        return SideBySide(
            task=self._task.task_id,
            seed=playback.episode.seed,
            source=self._candidate.source,
            steps=playback.result.steps,
            native_success=native is not None,
            our_success=ours is not None,
            success_step=None if native is None or ours is None else max(native, ours),
            max_state_difference=playback.max_state_difference,
            frames=pixels.frames,
            differing_frames=pixels.differing_frames,
            mean_pixel_difference=pixels.mean,
            max_pixel_difference=pixels.largest,
            live_difference=self._live_difference,
            panel_size=size,
            difference_gain=self._options.gain,
            clip=f"{NAME}.mp4",
            sheet=f"{NAME}.png",
        )


def _success_text(made: SideBySide) -> str:
    if made.success_step is not None:
        return f"success: both by step {made.success_step}"
    if made.native_success or made.our_success:
        return f"success: only {'native' if made.native_success else 'ours'}"
    return "success: neither"


def _write_png(path: Path, picture: Picture) -> None:
    import imageio.v3 as imageio

    _write(path, imageio.imwrite("<bytes>", picture, extension=".png"))


def _write(path: Path, content: bytes) -> None:
    partial = path.with_name(f"{path.name}.{os.getpid()}.partial")
    try:
        partial.write_bytes(content)
        os.replace(partial, path)
    except OSError as error:
        raise RecordingError(f"cannot write {path}: {error.strerror}") from error
    finally:
        partial.unlink(missing_ok=True)
