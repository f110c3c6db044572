# SPDX-License-Identifier: MIT OR Apache-2.0
"""Pictures of sweeps."""

import numpy as np
import pytest
from matplotlib.colors import to_rgba

import bearslam
from bearslam import InvalidInputError
from bearslam.montecarlo.plot import STROKES, draw_errors, draw_failures
from bearslam.plotting.map import save_figure


@pytest.fixture(scope="module")
def result():
    return bearslam.sweep(["mixed", "enclosed"], [4, 6, 8], [9, 7], np.radians([0.5, 0.1]), trials=10)


@pytest.fixture(scope="module")
def part():
    def progress(stage, done, total):
        raise KeyboardInterrupt

    return bearslam.sweep("mixed", [4, 6], [7, 9], 0.01, trials=3, progress=progress, threads=1)


def maps(figure):
    return [ax for ax in figure.axes if ax.images]


def numbers(ax):
    """What is printed in the cells, as the rates are laid out."""
    texts = {(round(y), round(x)): text.get_text() for text in ax.texts for x, y in [text.get_position()]}
    return [[texts.get((view, landmark)) for landmark in range(2)] for view in range(3)]


def test_failures_are_maps_with_numbers(result):
    figure = result.plot()
    axes = maps(figure)
    assert len(axes) == 4 * 3
    for index, ax in enumerate(axes):
        row, start = divmod(index, 3)
        rate = result.failure_rate[result.start[start]][row // 2, row % 2]
        np.testing.assert_array_equal(ax.images[0].get_array(), rate)
        assert numbers(ax) == [[f"{100 * share:.0f}" for share in line] for line in rate]
        assert ax.images[0].origin == "lower"
        assert ax.images[0].get_clim() == (0, 1)
        assert ax.images[0].cmap.name == "gray_r"
    assert [ax.get_title() for ax in axes[:3]] == ["random start", "projective start", "solve"]
    assert [ax.get_ylabel().split("\n")[0] for ax in axes[::3]] == [
        "mixed, 0.5°",
        "mixed, 0.1°",
        "enclosed, 0.5°",
        "enclosed, 0.1°",
    ]
    assert [label.get_text() for label in axes[-1].get_xticklabels()] == ["9", "7"]
    assert "10 scenes" in figure.get_suptitle()
    assert len(figure.axes) == 13  # and a bar of the colours


def test_numbers_can_be_read(result):
    for ax in maps(result.plot()):
        for text in ax.texts:
            x, y = text.get_position()
            behind = ax.images[0].to_rgba(ax.images[0].get_array())[round(y), round(x)]
            # Contrast as the guidelines for accessible pages count it; they ask for 4.5, and 3 for what is large.
            light, dark = sorted((luminance(behind), luminance(to_rgba(text.get_color()))), reverse=True)
            assert (light + 0.05) / (dark + 0.05) > 4.0


def luminance(color):
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in color[:3]]
    return np.dot([0.2126, 0.7152, 0.0722], linear)


def test_what_is_not_done_is_hatched(part):
    figure = part.plot()
    ax = maps(figure)[0]
    assert len(ax.texts) == (part.done > 0).sum() == 4 - len(ax.patches)
    assert all(patch.get_hatch() for patch in ax.patches)
    assert "not all done" in figure.get_suptitle()


def test_a_few_failures_do_not_look_like_none():
    assert [bearslam.montecarlo.plot._percent(share) for share in (0, 1e-9, 0.006, 0.5, 0.9951, 1)] == [
        "0",
        "<1",
        "1",
        "50",
        ">99",
        "100",
    ]


def test_errors_are_lines_against_noise(result):
    figure = result.plot("errors", quantity="heading", starts=["projective", "solve"], views=6)
    upper, lower = figure.axes[:2], figure.axes[2:4]
    assert [ax.get_title() for ax in upper] == ["mixed", "enclosed"]
    for layout, above, below in zip(result.layout, upper, lower, strict=True):
        for start in ("projective", "solve"):
            color = STROKES[start].color
            median, p90 = [line for line in above.get_lines() if line.get_color() == color]
            totals = [result.total(start, layout=layout, noise=np.radians(deg), views=6) for deg in (0.1, 0.5)]
            np.testing.assert_allclose(median.get_xdata(), [0.1, 0.5])
            np.testing.assert_allclose(median.get_ydata(), [np.degrees(total.heading_median) for total in totals])
            np.testing.assert_allclose(p90.get_ydata(), [np.degrees(total.heading_p90) for total in totals])
            (ratio,) = [line for line in below.get_lines() if line.get_color() == color]
            np.testing.assert_allclose(ratio.get_ydata(), [total.heading_ratio for total in totals])
        for ax in (above, below):
            assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
            low, high = ax.get_ylim()
            shown = np.concatenate([np.asarray(line.get_ydata()) for line in ax.get_lines()])
            assert ((shown > low) & (shown < high)).all()
    assert [text.get_text() for text in figure.legends[0].get_texts() if text.get_text()] == [
        "projective start",
        "median",
        "solve",
        "90th percentile",
        "Cramér-Rao bound",
    ]
    assert figure.get_suptitle().startswith("Errors with 6 views, 7 to 9 landmarks")


def test_starts_are_told_apart_by_more_than_colour():
    assert len({stroke.marker for stroke in STROKES.values()}) == 4
    assert len({stroke.line for stroke in STROKES.values()}) == 4


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda one: one.plot("errors", quantity="angle"), "quantity: expected 'position' or 'heading', got 'angle'"),
        (lambda one: one.plot("errors", views=5), "views: expected one of the sweep"),
        (lambda one: one.plot(starts=["calibrated"]), "starts: expected 'random' or 'projective' or 'solve', got"),
        (lambda one: one.plot(starts=[]), "starts: expected at least one, got none"),
        (lambda one: draw_errors(bearslam.sweep("mixed", 4, 7, 0, trials=1)), "result: expected a sweep with noise"),
    ],
)
def test_what_cannot_be_drawn_is_refused(result, call, message):
    with pytest.raises(InvalidInputError, match=message):
        call(result)


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_pictures_are_the_same_each_time(part, tmp_path, suffix):
    for draw in (draw_failures, draw_errors):
        paths = [tmp_path / f"{name}{suffix}" for name in "ab"]
        for path in paths:
            save_figure(draw(part), path)
        assert paths[0].read_bytes() == paths[1].read_bytes()
        assert len(paths[0].read_bytes()) > 5000


def test_nothing_is_cut_off(result, part):
    for figure in (result.plot(), part.plot(), part.plot("errors"), part.plot(starts="solve"), result.plot("errors")):
        figure.draw_without_rendering()
        box, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
        assert box.x0 >= 0
        assert box.x1 <= width
        assert box.y0 >= 0
        assert box.y1 <= height
