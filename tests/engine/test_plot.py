"""The rasteriser of plots: where ink falls, and PNG files that others read."""

import struct
import zlib

import numpy as np
import pytest

from glint.engine.analysis import plot

WHITE = (1.0, 1.0, 1.0)


def dark(width=40, height=30):
    return plot.canvas(width, height, (0.0, 0.0, 0.0))


def test_a_horizontal_line_covers_its_length_times_its_width():
    image = dark()
    plot.draw_line(image, (5, 10), (30, 10), WHITE, 3.0)
    # Between its round ends: rows 9 to 11 whole, 8 and 12 not at all.
    np.testing.assert_array_equal(image[9:12, 6:30], 1.0)
    assert (
        not image[:8].any()
        and not image[13:].any()
        and not image[:, :3].any()
        and not image[:, 33:].any()
    )


def test_a_dot_has_the_area_of_a_disc():
    image = dark()
    plot.draw_dot(image, (20, 15), 8.0, WHITE)
    # Smooth edges make the error of the area far smaller than the pixels on the rim.
    assert image[..., 0].sum() == pytest.approx(np.pi * 64, rel=0.01)
    ring = dark()
    plot.draw_dot(ring, (20, 15), 8.0, WHITE, ring=2.0)
    assert ring[15, 20].sum() == 0 and ring[..., 0].sum() == pytest.approx(
        2 * np.pi * 8 * 2, rel=0.02
    )


@pytest.mark.parametrize(
    "start", [(-50.0, -50.0), (1e9, 3.0), (float("nan"), 3.0), (float("inf"), 0.0)]
)
def test_what_leaves_the_canvas_is_cut_off(start):
    image = dark()
    plot.draw_line(image, start, start, WHITE)
    plot.draw_dot(image, start, 3, WHITE)
    plot.draw_text(image, "CUT", (-9, -3))
    plot.draw_text(image, "CUT", (38, 28))
    assert np.isfinite(image).all() and image.shape == (30, 40, 3)


@pytest.mark.parametrize("scale", [1, 2])
def test_letters_are_told_apart(scale):
    """Small and capital ones, and of other languages; what is not known is a question mark."""
    letters = plot.LETTERS + "\u2603"
    pictures = set()
    for letter in letters:
        image = dark(30, 40)
        plot.draw_text(image, letter, (8, 10), WHITE, scale)
        edges = image[:, 0], image[:, -1], image[0], image[-1]
        assert image.max() > 0.3 and not any(edge.any() for edge in edges)
        pictures.add(image.tobytes())
    assert len(pictures) == len(letters) - 1


def test_text_is_as_wide_as_it_says_and_aligns():
    image, longer = dark(90, 20), dark(90, 20)
    plot.draw_text(image, "Hill", (80, 4), WHITE, align=1.0)
    columns = np.nonzero(image.any((0, 2)))[0]
    width = plot.text_width("Hill")
    assert 80 - width <= columns.min() <= 80 - width + 2 and 77 <= columns.max() <= 80
    assert image[4].any() and not image[3, 80 - width :].max() > 0.9
    assert plot.text_width("mm") > 1.5 * plot.text_width("ll")
    plot.draw_text(longer, "Hi ll", (80, 4), WHITE, align=1.0)
    assert plot.text_width("Hi ll") > width


def test_a_png_holds_the_pixels():
    image = np.random.default_rng(3).random((5, 7, 3))
    data = plot.png_bytes(image)
    chunks, place = {}, 8
    while place < len(data):
        size, kind = struct.unpack_from(">I4s", data, place)
        body = data[place + 8 : place + 8 + size]
        assert struct.unpack_from(">I", data, place + 8 + size)[0] == zlib.crc32(kind + body)
        chunks[kind] = body
        place += size + 12
    assert struct.unpack(">IIBBBBB", chunks[b"IHDR"]) == (7, 5, 8, 2, 0, 0, 0)
    rows = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), np.uint8).reshape(5, 22)
    np.testing.assert_array_equal(rows[:, 1:].reshape(5, 7, 3), np.rint(image * 255))
