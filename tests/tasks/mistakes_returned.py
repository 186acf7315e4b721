"""What authors of tasks get wrong in what they return of states: info, observations, rewards."""

import math

import numpy as np

from tests.tasks.mistakes import (
    Mistake,
    evaluating,
    in_place,
    in_turn,
    observing,
    rewarding,
    success,
)

MISTAKES = (
    Mistake(
        "evaluate that forgets to return",
        evaluating(lambda state: None),
        "Tray.evaluate() returned None; it must return a dict of arrays by name",
    ),
    Mistake(
        "success by another name",
        evaluating(lambda state: {"solved": success(state)}),
        (
            "Tray.evaluate() returned no 'success', (N,) bool, which says where the task is "
            "solved; it returned: solved. A task that is never solved says open_ended = True"
        ),
    ),
    Mistake(
        "success of one environment",
        evaluating(lambda state: {"success": success(state)[0]}),
        (
            "Tray.evaluate() returned 'success' as the single bool False; it must have shape "
            "(2,), one for each environment: x[:, 2], not x[0, 2]; x.any(1), not x.any()"
        ),
    ),
    Mistake(
        "success as numbers",
        evaluating(lambda state: {"success": success(state) * 1.0}),
        (
            "Tray.evaluate() returned 'success' as float64 of shape (2,); it must be bool, as "
            "comparisons give it: distance <= 0.02"
        ),
    ),
    Mistake(
        "failure as numbers",
        evaluating(lambda state: {"success": success(state), "fail": success(state) * 1.0}),
        (
            "Tray.evaluate() returned 'fail' as float64 of shape (2,); it must be bool, as "
            "comparisons give it: distance <= 0.02"
        ),
    ),
    Mistake(
        "success of what is never solved",
        {"open_ended": True, **evaluating(lambda state: {"success": success(state)})},
        (
            "Tray.evaluate() returned 'success', and the task says open_ended = True; drop one of "
            "the two"
        ),
    ),
    Mistake(
        "success as a column",
        evaluating(lambda state: {"success": state.position("cube")[:, 2:] > 0.2}),
        (
            "Tray.evaluate() returned 'success' as bool of shape (2, 1); it must have shape "
            "(2,); [..., 0] leaves the last axis out"
        ),
    ),
    Mistake(
        "a mean over environments",
        evaluating(lambda state: {"success": success(state), "mean": success(state).mean()}),
        (
            "Tray.evaluate() returned 'mean' as the single float64 0.0; it must have shape (2, "
            "…), one for each environment: x[:, 2], not x[0, 2]; x.any(1), not x.any()"
        ),
    ),
    Mistake(
        "texts in the info",
        evaluating(lambda state: {"success": success(state), "phase": np.array(["a", "b"])}),
        (
            "Tray.evaluate() returned 'phase' as <U1 of shape (2,); it must be an array of shape "
            "(2, …), of numbers or flags"
        ),
    ),
    Mistake(
        "a name that info has",
        evaluating(lambda state: {"success": success(state), "elapsed_steps": success(state)}),
        ("Tray.evaluate() returned elapsed_steps, which info already has; call it something else"),
    ),
    Mistake(
        "a number as a name",
        evaluating(lambda state: {"success": success(state), 1: success(state)}),
        "Tray.evaluate() returned the name 1; names must be texts",
    ),
    Mistake(
        "a misspelt body",
        evaluating(lambda state: {"success": state.position("cub")[:, 2] > 0}),
        (
            "unknown body of this world 'cub'. Did you mean 'cube'? Choices: table-workspace, "
            "ground, cube."
        ),
    ),
    Mistake(
        "a misspelt robot",
        evaluating(lambda state: {"success": state.tcp_position("arn")[:, 2] > 0}),
        "unknown robot of this layout 'arn'. Did you mean 'arm'? Choices: arm.",
    ),
    Mistake(
        "a state changed by evaluate",
        evaluating(lambda state: {"success": in_place(state) > 0}),
        (
            "Tray.evaluate() changed the poses of the state, which share its memory; change a "
            "copy: tasks.maths.copy(x)"
        ),
    ),
    Mistake(
        "more in the info later",
        evaluating(
            in_turn(
                lambda state: {"success": success(state)},
                lambda state: {"success": success(state), "grasped": success(state)},
            )
        ),
        (
            "Tray.evaluate() returned other names than at first (it has 'grasped'); it must "
            "return the same ones every time"
        ),
        steps=2,
    ),
    Mistake(
        "another type later",
        evaluating(
            in_turn(
                lambda state: {"success": success(state), "high": success(state)},
                lambda state: {"success": success(state), "high": success(state) * 1.0},
            )
        ),
        (
            "Tray.evaluate() returned 'high' as float64 of shape (2,); at first it was bool of "
            "shape (2,), and must stay that"
        ),
        steps=2,
    ),
    Mistake(
        "observations as a list",
        observing(lambda state: [state.pose("cube")]),
        "Tray.observe() returned a list; it must return a dict of arrays by name",
    ),
    Mistake(
        "an observation of matrices",
        observing(lambda state: {"cube": state.rotation("cube")}),
        (
            "Tray.observe() returned 'cube' as float32 of shape (2, 3, 3); it must have shape "
            "(2,) or (2, k)"
        ),
    ),
    Mistake(
        "other names later",
        observing(
            in_turn(
                lambda state: {"a": state.pose("cube")}, lambda state: {"b": state.pose("cube")}
            )
        ),
        (
            "Tray.observe() returned other names than at first (it has 'b' and it lacks 'a'); it "
            "must return the same ones every time"
        ),
        steps=3,
    ),
    Mistake(
        "an observation of NaN",
        observing(lambda state: {"h": state.pose("cube") * math.nan}),
        "Tray.observe(): 'h' is nan in environment 0 at step 0; it must be finite",
    ),
    Mistake(
        "a reward as a column",
        rewarding(lambda state: state.position("cube")[:, 2:]),
        (
            "Tray.dense_reward() returned float32 of shape (2, 1); it must have shape (2,); "
            "[..., 0] leaves the last axis out"
        ),
        steps=1,
    ),
    Mistake(
        "a mean as a reward",
        rewarding(lambda state: state.position("cube")[:, 2].mean()),
        (
            "Tray.dense_reward() returned the single float32 0.0199999138712883; it must have "
            "shape (2,), one for each environment: x[:, 2], not x[0, 2]; x.any(1), not x.any()"
        ),
        steps=1,
    ),
    Mistake(
        "flags as a reward",
        rewarding(success),
        (
            "Tray.dense_reward() returned bool of shape (2,); it must be a floating array of "
            "shape (2,), one reward for each environment: tasks.maths.floats makes one of flags"
        ),
        steps=1,
    ),
    Mistake(
        "a reward of NaN",
        rewarding(lambda state: state.position("cube")[:, 2] * math.nan),
        ("Tray.dense_reward() returned nan in environment 0 at step 1; it must be finite"),
        steps=1,
    ),
    Mistake(
        "a reward of another type later",
        rewarding(
            in_turn(
                lambda state: success(state).astype(np.float32),
                lambda state: success(state).astype(np.float64),
                calls=1,
            )
        ),
        ("Tray.dense_reward() returned float64; at first it was float32, and must stay that"),
        steps=2,
    ),
)
