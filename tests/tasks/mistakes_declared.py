"""What authors of tasks get wrong in what a class declares."""

from tasks import Camera, Cube
from tests.tasks.mistakes import Mistake, Tray

MISTAKES = (
    Mistake(
        "no layout",
        dict(layout=None),
        (
            "Tray sets no layout: which robots stand where, such as layout = "
            "layouts.single({'arm': 'panda'})"
        ),
    ),
    Mistake(
        "robots in the place of a layout",
        dict(layout={"arm": "panda"}),
        (
            "Tray.layout is {'arm': 'panda'}; a layouts.Layout is needed, such as "
            "layouts.single({'arm': 'panda'})"
        ),
    ),
    Mistake(
        "no length of episodes",
        dict(max_episode_steps=None),
        (
            "Tray sets no max_episode_steps: after how many control steps an episode is "
            "truncated, such as max_episode_steps = 100"
        ),
    ),
    Mistake(
        "episodes of no step",
        dict(max_episode_steps=0),
        "Tray.max_episode_steps is 0; it must be an integer from 1 to 2147483647",
    ),
    Mistake(
        "no evaluate",
        dict(evaluate=None),
        (
            "Tray does not define evaluate(self, state), which says where it is solved: "
            "{'success': (N,) bool}"
        ),
    ),
    Mistake(
        "a misspelt evaluate",
        dict(evaluate=None, evalute=Tray.evaluate),
        (
            "Tray does not define evaluate(self, state), which says where it is solved: "
            "{'success': (N,) bool}. Is 'evalute' meant to be it?"
        ),
    ),
    Mistake(
        "a misspelt dense_reward",
        dict(dense_reward=None, dense_rewards=Tray.dense_reward),
        ("Tray defines 'dense_rewards', which nothing calls. Did you mean 'dense_reward'?"),
    ),
    Mistake(
        "evaluate without a state",
        dict(evaluate=lambda self: {}),
        "Tray.evaluate takes (self); it is called as def evaluate(self, state)",
    ),
    Mistake(
        "a reward without an action",
        dict(dense_reward=lambda self, state, info: 0),
        (
            "Tray.dense_reward takes (self, state, info); it is called as def dense_reward(self, "
            "state, action, info)"
        ),
    ),
    Mistake(
        "sample without rng",
        dict(sample=lambda self, world: 0),
        ("Tray.sample takes (self, world); it is called as def sample(self, world, rng)"),
    ),
    Mistake(
        "evaluate that yields",
        dict(evaluate=lambda self, state: (yield)),
        "Tray.evaluate must return its result; it has async or yield",
    ),
    Mistake(
        "one reward mode",
        dict(reward_modes="sparse"),
        (
            "Tray.reward_modes is 'sparse'; a tuple of normalized_dense, dense, sparse, none is "
            "needed, the default first"
        ),
    ),
    Mistake(
        "a dense mode without a dense reward",
        dict(reward_modes=("dense",), dense_reward=None),
        (
            "Tray.reward_modes has 'dense', but it does not define dense_reward(self, state, "
            "action, info)"
        ),
    ),
    Mistake(
        "a largest reward of 0",
        dict(max_reward=0),
        "Tray.max_reward is 0; it must be a number from 1e-06 to 1e+06",
    ),
    Mistake(
        "numbers of robots as a pair",
        dict(robot_counts=(1, 2)),
        (
            "Tray.robot_counts is (1, 2); a range of 1 or more numbers is needed, such as "
            "range(2, 5) for two to four robots"
        ),
    ),
    Mistake(
        "a layout of too few robots",
        dict(robot_counts=range(2, 4)),
        "Tray.layout has 1 robots, which are not in its robot_counts, range(2, 4)",
    ),
    Mistake(
        "one pattern in the place of a tuple",
        dict(sensed="*tcp_pose"),
        (
            "Tray.sensed is '*tcp_pose'; a tuple of names is needed, such as ('*tcp_pose',) with "
            "its comma"
        ),
    ),
    Mistake(
        "one camera in the place of a tuple",
        dict(cameras=Camera((0, 0, 1.0), (0, 0, 0))),
        (
            "Tray.cameras is Camera(eye=(0.0, 0.0, 1.0), target=(0....ount=None, "
            "intrinsic=None, shader=None); a tuple of tasks.Camera is needed, such as "
            "(Camera((0.3, 0, 0.6), (0, 0, 0.1)),) with its comma"
        ),
    ),
    Mistake(
        "one point in the place of two",
        dict(viewpoint=(0, 0, 1)),
        ("Tray.viewpoint is (0, 0, 1); the camera's position and target are needed (m)"),
    ),
    Mistake(
        "physics as a dict",
        dict(physics={"a": 1}),
        "Tray.physics is {'a': 1}; tasks.PhysicsSettings or None is needed",
    ),
    Mistake(
        "a negative seed",
        dict(first_seed=-1),
        "Tray.first_seed is -1; it must be an integer from 0 to 4294967295",
    ),
    Mistake(
        "a body's class",
        dict(cube=Cube),
        "Tray.cube is the class Cube; a body is one that it makes: cube = Cube(…)",
    ),
    Mistake(
        "a body called as what every task has",
        dict(memory=Cube(0.02)),
        (
            "Tray.memory is a body, but 'memory' is a name that every task has for something else; "
            "call it something else"
        ),
    ),
    Mistake(
        "a step of its own",
        dict(step=lambda self, action: None),
        "Tray defines step, which nothing calls: tasks are stepped by tasks.TaskEnv, and define "
        "design, build, sample, evaluate, observe, dense_reward, remember, begin_episodes, "
        "begin_step, respond, reset_robots",
    ),
    Mistake(
        "a body called table",
        dict(table=Cube(0.02)),
        (
            "Tray.table is Cube(spawn=None, start=None, kind='dyn..._size=0.02, color=(1.0, 0.0, "
            "0.0, 1.0)); a tasks.Surroundings is needed, such as tasks.Table(), and other bodies "
            "go by other names"
        ),
    ),
    Mistake("a number as a flag", dict(rebuilds=1), "Tray.rebuilds is 1; it must be True or False"),
)
