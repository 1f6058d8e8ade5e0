"""Marks one report against the truth. Reads the report as `touchstone diagnose --json` writes it, and nothing else."""
import dataclasses
import math

import data_errors

CONFIDENT = 0.9
OVER_FLOOR = 1.1

# Effects that are the same to the pictures, or nearly: the first step may name one for the other if it says so in
# `equivalent`. Any other pair must be told apart.
CLASSES = (("camera_rotation", "principal_point"), ("camera_rotation", "camera_translation"),
           ("principal_point", "camera_translation"), ("focal_error", "camera_translation"))
NOISE = ("image_noise",)

# Parameter names by effect, in the order of the truth's values; (name, axis).
PARAMETERS = {
    "focal_error": (("relative", ""),),
    "radial_distortion": (("k1", ""), ("k2", "")),
    "principal_point": (("offset_px", "x"), ("offset_px", "y")),
    "camera_translation": (("offset_mm", "x"), ("offset_mm", "y"), ("offset_mm", "z")),
    "camera_rotation": (("rotation_deg", "x"), ("rotation_deg", "y"), ("rotation_deg", "z")),
    "exposure": (("stops", ""),),
    "gamma": (("exponent", ""),),
    "vignetting": (("strength", ""),),
    "defocus_blur": (("sigma_px", ""),),
    "motion_blur": (("length_px", ""), ("angle_deg", "")),
    "light_position": (("offset_mm", "x"), ("offset_mm", "y"), ("offset_mm", "z")),
    "ambient_light": (("level", ""),),
    "cast_shadow": (("strength", ""),),
    "specular": (("strength", ""), ("exponent", "")),
    "background_level": (("grey", ""),),
    "black_level": (("grey", ""),),
    "response": (("curve", ""),),
}


@dataclasses.dataclass
class Mark:
    report: bool = False
    verdict: str = ""
    claims: list = dataclasses.field(default_factory=list)
    probability: float = 0.0
    false_claim: bool = False
    right_first: bool = False
    all_found: bool = False  # and none added
    confidently_wrong: bool = False
    right: bool = False  # the answer that the arm wants
    honest: bool = False
    over_floor: float = math.nan  # final error over the report's own noise floor
    covered: list = dataclasses.field(default_factory=list)  # of each value, by its 95 % interval
    errors: list = dataclasses.field(default_factory=list)  # of each value, in standard errors
    missed_fall: bool = False  # `compare` does not find the error that the report says the model falls to
    seconds: float = 0.0
    cpu_seconds: float = 0.0


def _number(value):
    """Of a report: numbers that are not known are the string "NaN"."""
    return float(value if value is not None else math.nan)


def _steps(report):
    return [s for s in report.get("steps", []) if s["effect"] not in NOISE]


def _is(step, effect):
    """Whether the step names the effect, by itself or as one that cannot be told from it."""
    if step["effect"] == effect:
        return True
    pair = {step["effect"], effect}
    return effect in step.get("equivalent", []) and any(pair == set(c) for c in CLASSES)


def _parameters(step):
    return {(p["name"], p.get("finger", "")): p for p in step.get("parameters", []) if not p.get("object")}


def _cover(step, values, mark):
    found = _parameters(step)
    values = [values] if not isinstance(values, (list, tuple)) else values
    for key, truth in zip(PARAMETERS[step["effect"]], values):
        estimate = found.get(key)
        value, error = (_number((estimate or {}).get(field)) for field in ("value", "std_error"))
        if not error > 0:
            continue
        if key[0] == "angle_deg":  # a direction without a sign
            truth = value + (truth - value + 90) % 180 - 90
        low, high = _number(estimate["lower"]), _number(estimate["upper"])
        mark.covered.append(bool(low <= truth <= high))
        if error > 0:  # a choice has none
            mark.errors.append((value - truth) / error)


def of_photographs(report):
    """The report's entry of photographs; {} without one."""
    return next((data for data in report.get("data", []) if data["kind"] == "PHOTOGRAPHS"), {})


def judge(report, truth, seconds):
    """truth: as sets.Truth, a dict. report: None if there is none."""
    mark = Mark(seconds=seconds)
    if report is None:
        return mark
    mark.report, mark.verdict = True, report.get("verdict", "")
    steps = _steps(report)
    mark.claims = [s["effect"] for s in steps]
    mark.probability = _number(steps[0].get("probability")) if steps else 0.0
    hidden = truth["effects"]
    data = of_photographs(report)
    floor = _number(data.get("noise_floor"))
    if floor > 0 and data.get("final"):
        mark.over_floor = _number(data["final"].get("rmse")) / floor

    true_step = lambda s: any(_is(s, e) for e in hidden)
    wrong_steps = [s for s in steps if not true_step(s)]
    # A step that holds the truth among its equivalents blames nothing.
    blames = [s for s in wrong_steps
              if _number(s.get("probability")) > CONFIDENT and not set(s.get("equivalent", [])) & set(hidden)]
    mistakes = [p["kind"].lower() for p in report.get("data_problems", [])]
    mark.right_first = bool(steps) and true_step(steps[0])
    mark.all_found = (all(any(_is(s, e) for s in steps) for e in hidden) and not wrong_steps
                      and mark.verdict == "MISSING_EFFECTS") if hidden else not steps
    for step in steps:
        if step["effect"] in hidden:
            _cover(step, hidden[step["effect"]], mark)

    strong = truth["strength"] == "strong"
    wrong_values = [r["effect"] for r in report.get("refitted", []) if r["effect"] not in NOISE]
    if truth["data_error"]:
        mark.right = mark.verdict == "CHECK_DATA" and mistakes[:1] != [] and \
            mistakes[0] in data_errors.KINDS[truth["data_error"]]
        mark.confidently_wrong = not mark.right and (mark.verdict in ("CHECK_DATA", "ADEQUATE") or bool(blames))
        mark.honest = mark.right or not mark.confidently_wrong
        return mark

    mark.confidently_wrong = bool(blames) or mark.verdict == "CHECK_DATA" or \
        (mark.verdict == "WRONG_VALUES" and not hidden) or (mark.verdict == "ADEQUATE" and strong)
    if truth["unlisted"]:
        mark.right = mark.verdict == "UNEXPLAINED" and not mark.confidently_wrong
        mark.honest = not mark.confidently_wrong
    elif hidden:
        mark.right = mark.all_found and not mark.confidently_wrong
        mark.honest = not mark.confidently_wrong and (
            mark.right or mark.verdict in ("UNEXPLAINED", "TOO_LITTLE_DATA") or truth["strength"] == "weak"
            or all(true_step(s) for s in steps))
    else:
        mark.false_claim = bool(steps) or bool(wrong_values) or \
            (mark.verdict in ("WRONG_VALUES", "UNEXPLAINED", "CHECK_DATA", "MISSING_EFFECTS") and \
            not (mark.verdict == "MISSING_EFFECTS" and not steps))
        mark.right = mark.honest = not mark.false_claim
    return mark


def interval(hits, count, level=0.95):
    """Clopper and Pearson's, of a share: (lower, upper)."""
    if count == 0:
        return 0.0, 1.0

    def at_least(k, p):  # P(X >= k)
        return sum(math.comb(count, j) * p ** j * (1 - p) ** (count - j) for j in range(k, count + 1))

    def solve(f):
        low, high = 0.0, 1.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if f(middle) else (low, middle)
        return 0.5 * (low + high)

    tail = 0.5 * (1 - level)
    lower = 0.0 if hits == 0 else solve(lambda p: at_least(hits, p) < tail)
    upper = 1.0 if hits == count else solve(lambda p: 1 - at_least(hits + 1, p) > tail)
    return lower, upper
