"""FLIP against the authors' own evaluator (its values for this pair of pictures) and against what
the paper says of it.
"""

import numpy as np
import pytest

from glint.engine.analysis.flip import flip

HEIGHT, WIDTH = 24, 32


def pair():
    """(picture, reference): a smooth reference; a picture with a darker box, a faint pattern and a
    bright line.
    """
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    reference = np.stack([x / WIDTH, y / HEIGHT, 0.5 + 0.4 * np.sin(x / 3.0) * np.cos(y / 4.0)], -1)
    picture = reference.copy()
    picture[5:9, 6:20] *= 0.4
    picture += 0.02 * np.sin(5 * x + 3 * y)[..., None]
    picture[15:, 25] = [1, 0, 1]
    return np.clip(picture, 0, 1), np.clip(reference, 0, 1)


def test_it_equals_the_authors_evaluator():
    """flip-evaluator 1.7 (LDR, linear input) computes in float32; so do its values of the map, to
    1e-5.
    """
    seen = flip(*pair())
    assert seen.mean() == pytest.approx(0.143124520778656, abs=1e-6)
    assert np.percentile(seen, 99) == pytest.approx(0.7056486, abs=1e-5)
    for place, value in (((6, 10), 0.64674544), ((20, 25), 0.777597), ((0, 0), 0.02821894)):
        assert seen[place] == pytest.approx(value, abs=2e-5)


def test_equal_pictures_differ_nowhere():
    _, reference = pair()
    assert flip(reference, reference).max() == 0.0


def test_black_against_white_differs_as_much_as_can_be_but_for_hue():
    """Equation 6 puts the largest distance of the gamut, green against blue, at 1; white against
    black is a lightness step of 100.
    """
    black, white = np.zeros((9, 9, 3)), np.ones((9, 9, 3))
    assert flip(white, black)[4, 4] == pytest.approx(0.9704, abs=0.02)
    green, blue = black + [0, 1, 0], black + [0, 0, 1]
    assert flip(green, blue)[4, 4] == pytest.approx(1.0, abs=1e-9)


def test_what_a_screen_cannot_show_is_not_seen():
    bright = np.full((8, 8, 3), 1.0)
    assert flip(7 * bright, bright).max() == 0.0
    assert np.isfinite(flip(np.nan * bright, bright)).all()


def test_shapes_must_agree():
    with pytest.raises(ValueError, match="compare equal shapes"):
        flip(np.zeros((4, 4, 3)), np.zeros((4, 5, 3)))
