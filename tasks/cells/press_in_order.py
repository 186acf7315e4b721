"""CellPressInOrder: eight arms of different makes press their buttons in the order told."""

from __future__ import annotations

from layouts import ring
from tasks import CellTask, EpisodeRandom, Object, State, World, register_task
from tasks.maths import Array, Floats, floats, where

MAKES = ("ur10", "panda_stick", "xarm7")
ARMS = tuple("south southeast east northeast north northwest west southwest".split())
PHRASES = (
    "Press the buttons one after the other, from {} on, {}.",
    "Starting at {}, press all buttons {}.",
    "Buttons in turn: {} first, then {}.",
)
WAYS = ("counterclockwise", "clockwise")
PRESSED = 0.005  # how far a cap goes in (m)


def order_of(phrasing: int) -> tuple[str, ...]:
    """Return the arms in the order in which the instruction of that number names them."""
    step = (1, -1)[phrasing % len(WAYS)]
    return tuple(ARMS[(phrasing + step * number) % len(ARMS)] for number in range(len(ARMS)))


TURNS = {arm: tuple(float(order_of(i).index(arm)) for i in range(len(ARMS))) for arm in ARMS}


@register_task("CellPressInOrder-v1")
class CellPressInOrder(CellTask):
    """Press all buttons in the order that the instruction tells; pressing too early starts over.

    The buttons stand 48 to 54 cm from the middle before their arms, up to 6 cm aside. The order is
    not observed.

    Success: all caps were pressed by 5 mm, one after the other, and none before its turn.
    """

    instruction = tuple(
        words.format(arm, WAYS[number % 2]) for words in PHRASES for number, arm in enumerate(ARMS)
    )
    layout = ring(dict(zip(ARMS, MAKES * 3, strict=False)), radius=1.0)
    max_episode_steps = 250
    stages = {"is_first_pressed": 0.2, "are_half_pressed": 0.6, "success": 1.0}
    viewpoint = ((1.6, 1.4, 1.5), (0.0, 0.0, 0.1))

    button_south = button_southeast = button_east = Object("button", kind="kinematic")
    button_northeast = button_north = button_northwest = Object("button", kind="kinematic")
    button_west = button_southwest = Object("button", kind="kinematic")

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Stand a button before each arm."""
        for arm in self.arms:
            self.lay_before(world, rng, arm, f"button_{arm}", (0.48, -0.06), (0.54, 0.06), (0, 0))

    def remember(self, state: State) -> dict[str, Array]:
        """How many buttons were pressed in their order so far."""
        return {"pressed": state.full(0.0)}

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: all were pressed, one after the other."""
        pressed = self.memory.pressed
        caps = [state.joint(f"button_{arm}", "cap") >= PRESSED for arm in self.arms]
        turns = [*zip(caps, self._turns(state), strict=True)]
        early = self.count([cap & (turn > pressed) for cap, turn in turns])
        right = self.count([cap & (turn == pressed) for cap, turn in turns])
        self.memory.pressed = pressed = where(early > 0, 0.0, pressed + right)
        half, done = pressed >= 4, pressed >= len(self.arms)
        return {"is_first_pressed": pressed >= 1, "are_half_pressed": half, "success": done}

    def ways(self, state: State) -> list[Floats]:
        """Of the tips to the caps that are still to be pressed."""
        top = self.button_south.descriptor.points["top"].position
        return [
            self.tip_distance(state, arm, f"button_{arm}", top)
            * floats(turn >= self.memory.pressed)
            for arm, turn in zip(self.arms, self._turns(state), strict=True)
        ]

    def _turns(self, state: State) -> list[Floats]:
        """Return by arm how many come before it, (N,)."""
        return [self.told(state, TURNS[arm]) for arm in self.arms]
