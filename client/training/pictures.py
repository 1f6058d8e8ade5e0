"""The pictures of train_small.py, drawn with Pillow."""

from __future__ import annotations

import functools

import numpy as np
from PIL import Image, ImageDraw, ImageFont

import touchstone

# Everything is drawn this much larger, then scaled down: smooth lines and letters.
_SUPER = 2
_INK, _GREY, _FAINT, _PAPER = "#1f2933", "#7b8794", "#e4e7eb", "#ffffff"
# Colours that the colour-blind can tell apart (Okabe and Ito).
_COLOURS = ["#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"]
_FINGERS, _NETWORKS = _COLOURS[:3], _COLOURS[3:]


@functools.cache
def _font(size, bold=False):
    folder = "/usr/share/fonts/truetype/dejavu/"
    for name in (f"DejaVuSans{'-Bold' if bold else ''}.ttf", folder + f"DejaVuSans{'-Bold' if bold else ''}.ttf"):
        try:
            return ImageFont.truetype(name, size * _SUPER)
        except OSError:
            continue
    return ImageFont.load_default()


class _Canvas:
    """Draws in final pixels."""

    def __init__(self, width, height):
        self._image = Image.new("RGB", (width * _SUPER, height * _SUPER), _PAPER)
        self._draw = ImageDraw.Draw(self._image)
        self._size = (width, height)

    def text(self, x, y, text, size=13, colour=_INK, anchor="la", bold=False):
        self._draw.text((x * _SUPER, y * _SUPER), text, colour, _font(size, bold), anchor=anchor)

    def rectangle(self, x0, y0, x1, y1, fill):
        if x1 > x0 and y1 > y0:
            self._draw.rectangle([v * _SUPER for v in (x0, y0)] + [v * _SUPER - 1 for v in (x1, y1)], fill)

    def line(self, points, colour, width=1):
        self._draw.line([(x * _SUPER, y * _SUPER) for x, y in points], colour, round(width * _SUPER), joint="curve")

    def band(self, edges, colour):
        """Between two edges, lists of points from left to right; what lies below it shows through."""
        lower, upper = ([(x * _SUPER, y * _SUPER) for x, y in edge] for edge in edges)
        cover = Image.new("L", self._image.size)
        ImageDraw.Draw(cover).polygon(lower + upper[::-1], 60)
        self._image.paste(colour, mask=cover)

    def dot(self, x, y, radius, colour):
        box = [(x - radius) * _SUPER, (y - radius) * _SUPER, (x + radius) * _SUPER, (y + radius) * _SUPER]
        self._draw.ellipse(box, colour)

    def paste(self, x, y, width, height, pixels):
        picture = Image.fromarray(pixels).resize((width * _SUPER, height * _SUPER), Image.BICUBIC)
        self._image.paste(picture, (x * _SUPER, y * _SUPER))

    def save(self, path):
        self._image.resize(self._size, Image.LANCZOS).save(path, optimize=True)
        return path


def _seen_by_the_camera(batch, fov_deg):
    """Where the contacts lie in the photographs: (rows, fingers, 2), right and down, from 0 to 1."""
    approach, lateral = batch["approach"][:, None], batch["lateral"][:, None]
    eye_mm = batch["target_mm"][:, None] - batch["standoff_mm"].reshape(-1, 1, 1) * approach
    ways = batch["contact_point_mm"] - eye_mm
    along = lambda direction: (ways * direction).sum(-1)
    # The camera of a touch looks along the approach, the lateral direction to the right.
    half = along(approach) * np.tan(np.radians(fov_deg / 2))
    return 0.5 + 0.5 * np.stack([along(lateral) / half, -along(np.cross(lateral, approach)) / half], -1)


def contact_sheet(client, objects, plan, seed, path, columns=7, side=132):
    """Each object touched `columns` times: the photograph with the contacts, and below it when each finger made it."""
    image = touchstone.image(2 * side, 2 * side)
    samples = client.samples(objects, plan, samples=len(objects) * columns, seed=seed, image=image,
                             columns=("descriptor", "pose", "contact", "image"))
    batch = samples[:]
    places = _seen_by_the_camera(batch, image.vertical_fov_deg)
    times_ms = batch["descriptor_us"] / 1e3
    fingers = times_ms.shape[1]
    names = "lmr" if fingers == 3 else [str(k) for k in range(fingers)]
    gap, left, top, bars = 14, 84, 78, 15 * fingers + 10
    canvas = _Canvas(left + columns * (side + gap) + gap, top + len(objects) * (side + bars + gap) + 30)
    canvas.text(20, 16, "What a training job receives", 19, bold=True)
    # One scale for all bars; the few longest are broken off, so that one of them does not make the others vanish.
    longest = max(1.0, float(np.nanpercentile(times_ms, 95)))
    canvas.text(20, 44, f"{columns} random touches of {len(objects)} objects: the view along the approach with the contacts, "
                "and how long after the first finger each one touched (ms). "
                f"Bars beyond {longest:.0f} ms are broken (//).", 12, _GREY)
    for row, name in enumerate(objects):
        y = top + row * (side + bars + gap)
        canvas.text(20, y + side // 2, name, 15, anchor="lm", bold=True)
        for column in range(columns):
            sample, x = column * len(objects) + row, left + column * (side + gap)
            canvas.paste(x, y, side, side, batch["image"][sample, :, :, 0])
            for finger in range(fingers):
                right, down = places[sample, finger]
                if 0 <= right <= 1 and 0 <= down <= 1:  # NaN: no contact
                    canvas.dot(x + right * side, y + down * side, 3.6, _PAPER)
                    canvas.dot(x + right * side, y + down * side, 2.6, _FINGERS[finger % 3])
                time_ms, line_y = float(times_ms[sample, finger]), y + side + 8 + 15 * finger
                canvas.text(x, line_y, names[finger], 10, _GREY)
                if np.isnan(time_ms):
                    canvas.text(x + 14, line_y, "no contact", 10, _GREY)
                    continue
                room = side - 14 - 36
                length = min(1.0, time_ms / longest) * room
                canvas.rectangle(x + 14, line_y + 1, x + 15 + length, line_y + 11, _FINGERS[finger % 3])
                if time_ms > longest:
                    for slash in (0, 5):
                        canvas.line([(x + length - 2 + slash, line_y + 12), (x + length + 2 + slash, line_y)], _PAPER, 2)
                canvas.text(x + 19 + length, line_y, f"{time_ms:.0f}", 10)
    return canvas.save(path)


def mean_and_range(shares):
    """ "68.0% (66.1 to 70.2)" of one accuracy a training."""
    return f"{np.mean(shares):.1%} ({100 * min(shares):.1f} to {100 * max(shares):.1f})"


def training_picture(history, confusion, objects, path):
    """Accuracy over examples seen, and what each network takes each object for."""
    cell, gap = 34, 30
    matrix = cell * len(objects)
    width, plot = 88 + 3 * matrix + 2 * gap + 40, (64, 96, 0, 380)
    plot = (64, 96, width - 150, 380)
    canvas = _Canvas(width, 380 + 92 + matrix + 36)
    canvas.text(24, 18, "Which object is it?", 19, bold=True)
    canvas.text(24, 46, "Accuracy on held-out examples, against the number of training examples seen, each of them new.",
                12, _GREY)
    trainings = len(next(iter(history[0][1].values())))
    canvas.text(24, 64, f"Lines: mean of {trainings} trainings from other first weights; bands: the worst to the best of them.",
                12, _GREY)
    x_of = lambda seen: plot[0] + (plot[2] - plot[0]) * seen / history[-1][0]
    y_of = lambda share: plot[3] - (plot[3] - plot[1]) * share
    for tick in range(0, 101, 20):
        canvas.line([(plot[0], y_of(tick / 100)), (plot[2], y_of(tick / 100))], _FAINT)
        canvas.text(plot[0] - 8, y_of(tick / 100), f"{tick} %", 11, _GREY, "rm")
    step = 10 ** int(np.log10(history[-1][0]))
    step = step // 5 if history[-1][0] < 2 * step else step // 2 if history[-1][0] < 5 * step else step
    for tick in range(0, history[-1][0] + 1, max(1, step)):
        canvas.line([(x_of(tick), plot[3]), (x_of(tick), plot[3] + 4)], _GREY)
        canvas.text(x_of(tick), plot[3] + 8, f"{tick:,}", 11, _GREY, "ma")
    # Chance, then a curve a network, its name at its end; names that would overlap are moved apart.
    chance = 1 / len(objects)
    for x in range(plot[0], plot[2], 10):
        canvas.line([(x, y_of(chance)), (x + 5, y_of(chance))], _GREY)
    labels = [(y_of(chance), f"chance {chance:.1%}", _GREY)]
    edge = lambda name, pick: [(x_of(seen), y_of(pick(accuracies[name]))) for seen, accuracies in history]
    for k, name in enumerate(confusion):
        canvas.band((edge(name, min), edge(name, max)), _NETWORKS[k])
    for k, name in enumerate(confusion):
        points = edge(name, np.mean)
        canvas.line(points, _NETWORKS[k], 2.2)
        for x, y in points[1:]:
            canvas.dot(x, y, 2.6, _NETWORKS[k])
        labels.append((points[-1][1], f"{name} {np.mean(history[-1][1][name]):.1%}", _NETWORKS[k]))
    last = -1e9
    for y, text, colour in sorted(labels):
        last = max(y, last + 17)
        canvas.text(plot[2] + 10, last, text, 12, colour, "lm", bold=colour != _GREY)
    # Rows are the true objects, columns what they were taken for, in percent of the row.
    top = 380 + 92
    for k, (name, counts) in enumerate(confusion.items()):
        left = 88 + k * (matrix + gap)
        canvas.text(left, top - 44, name, 14, _NETWORKS[k], bold=True)
        canvas.text(left, top - 23, "recognised as (%)", 10, _GREY)
        share = counts.numpy() / np.maximum(1, counts.numpy().sum(1, keepdims=True))
        ink = np.array([int(_NETWORKS[k][i : i + 2], 16) for i in (1, 3, 5)])
        for i, true in enumerate(objects):
            if k == 0:
                canvas.text(left - 8, top + (i + 0.5) * cell, true, 11, anchor="rm")
            canvas.text(left + (i + 0.5) * cell, top + matrix + 6, true.replace("lat", "") or true, 10, _GREY, "ma")
            for j in range(len(objects)):
                shade = tuple((255 + (ink - 255) * share[i, j]).astype(int))
                canvas.rectangle(left + j * cell, top + i * cell, left + (j + 1) * cell - 1, top + (i + 1) * cell - 1,
                                 shade if share[i, j] >= 0.005 else "#f5f7fa")
                if share[i, j] >= 0.005:
                    canvas.text(left + (j + 0.5) * cell, top + (i + 0.5) * cell, f"{100 * share[i, j]:.0f}", 10,
                                _PAPER if share[i, j] > 0.55 else _INK, "mm")
    return canvas.save(path)
