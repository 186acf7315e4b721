import math

import pytest
import torch

from tasks import EpisodeRandom

LOW, HIGH = (-0.1, -0.2), (0.1, 0.2)


def test_points_are_apart_and_within_their_region():
    for seed in range(50):
        points = EpisodeRandom(seed).points_apart(3, LOW, HIGH, torch.tensor(0.06))
        gaps = torch.cdist(points, points) + torch.eye(3)
        assert gaps.min() > 0.06
        assert (points >= torch.tensor(LOW)).all()
        assert (points <= torch.tensor(HIGH)).all()


def test_a_point_without_room_is_the_origin():
    points = EpisodeRandom(0).points_apart(2, LOW, HIGH, torch.tensor(10.0))
    assert points[0].tolist() != [0.0, 0.0]
    assert points[1].tolist() == [0.0, 0.0]


def test_a_yaw_may_be_bounded():
    rng = EpisodeRandom(0)
    yaws = []
    for _ in range(200):
        w, x, y, z = rng.yaw_quaternion(-math.pi / 6, math.pi / 6).tolist()
        assert (x, y) == (0.0, 0.0)
        yaws.append(2 * math.atan2(z, w))
    assert -math.pi / 6 <= min(yaws) < -0.4
    assert 0.4 < max(yaws) <= math.pi / 6


def test_what_native_draws_by_functions_that_round_otherwise():
    rng = EpisodeRandom(3)
    torch.manual_seed(3)
    assert torch.equal(rng.torch_uniform(-0.02, 0.02, 2), torch.zeros(2).uniform_(-0.02, 0.02))
    assert torch.equal(rng.torch_standard_normal(9), torch.randn(1, 9)[0])
    drawn = [rng.torch_whole(2, 5) for _ in range(20)]
    assert drawn == [int(torch.randint(2, 5, (1,))) for _ in range(20)]
    assert set(drawn) == {2, 3, 4}


def test_a_uniform_draw_may_be_less_spread():
    whole, half, none = EpisodeRandom(3), EpisodeRandom(3), EpisodeRandom(3)
    half.spread, none.spread = 0.5, 0.0
    drawn = whole.torch_uniform(1.0, 3.0, 4)
    assert half.torch_uniform(1.0, 3.0, 4) == pytest.approx(2 + (drawn - 2) / 2)
    assert none.torch_uniform(1.0, 3.0, 4).tolist() == [2.0] * 4
