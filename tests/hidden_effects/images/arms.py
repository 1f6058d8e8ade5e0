"""The arms of the benchmark: what is hidden in the sets of each. Seeds of tuning and of the table share no number."""
import dataclasses

import data_errors
import sets
import strengths
import unlisted

SEEDS = {"tuning": 1_000_000, "held-out": 2_000_000}
SETS_PER_ARM = 1000  # seeds of each arm

PAIRS = (("exposure", "defocus_blur"), ("focal_error", "vignetting"), ("camera_rotation", "gamma"),
         ("light_position", "background_level"), ("radial_distortion", "exposure"), ("camera_translation", "ambient_light"),
         ("principal_point", "specular"), ("motion_blur", "vignetting"), ("cast_shadow", "exposure"),
         ("gamma", "background_level"))

# Of unlisted causes: root mean square over as many pixels as see the object, in noise sigmas. Of a rolling shutter, whose
# size by that would be the flips of edge pixels alone: how far the picture moves while it is read, px.
UNLISTED_SIGMAS = {"realistic": 1.0, "strong": 4.0}
SHUTTER_PX = {"realistic": 1.0, "strong": 4.0}
ALBEDO = ((0.02, 40.0), (0.06, 30.0))  # rms, correlation length in mm


@dataclasses.dataclass(frozen=True)
class Arm:
    name: str
    group: str  # of the table
    sets: int  # of the whole run
    make: object  # seed -> Files


def _with_effects(arm, effects, strength, scene):
    truth = sets.Truth(arm, scene.seed, strength, effects)
    physics = sets.make_physics(effects)
    return sets.make_files(scene, truth, lambda number: physics)


def _nothing(seed):
    return _with_effects("nothing", {}, "", sets.make_scene(seed))


def _one(effect, strength):
    def make(seed):
        scene = sets.make_scene(seed)
        value = getattr(strengths, strength)(effect, scene)
        return _with_effects(f"{strength} {effect}", {effect: value}, strength, scene)

    return make


def _pair(pair):
    def make(seed):
        scene = sets.make_scene(seed)
        signal = strengths.Signal(scene)
        effects = {name: strengths.realistic(name, scene, signal) for name in pair}
        return _with_effects("pair " + " + ".join(pair), effects, "realistic", scene)

    return make


def _noise(seed):
    """The camera scatters more than the model says, and more in bright places."""
    scene = sets.make_scene(seed)
    random = sets.stream(seed, "noise size")
    noise = (random.uniform(2.5, 4), random.uniform(0.02, 0.08))
    truth = sets.Truth("noise", seed, noise=noise)
    return sets.make_files(scene, truth, lambda number: sets.make_physics({}, noise=noise))


def _albedo(rms, length_mm):
    def make(seed):
        scene = sets.make_scene(seed)
        truth = sets.Truth(f"albedo {rms:g}", seed, unlisted="albedo", notes={"rms": rms, "length_mm": length_mm})
        return sets.make_files(scene, truth, unlisted.smooth_albedo(scene, rms, length_mm))

    return make


def _unlisted_size(name, strength, scene):
    signal = strengths.Signal(scene)
    wanted = UNLISTED_SIGMAS[strength] * signal.object_pixels() ** 0.5
    size = 0.02
    for _ in range(8):
        got = signal.of({}, unlisted.physics_of(name, size, scene))
        if abs(got / wanted - 1) < 0.05:
            break
        size *= min(10.0, max(0.1, wanted / max(got, 1e-9)))
    return size


def _unlisted(name, strength):
    def make(seed):
        scene = sets.make_scene(seed)
        size = SHUTTER_PX[strength] if name == "rolling_shutter" else _unlisted_size(name, strength, scene)
        truth = sets.Truth(f"{strength} {name}", seed, strength, unlisted=name, notes={"size": size})
        return sets.make_files(scene, truth, unlisted.physics_of(name, size, scene))

    return make


def _overexposed(seed):
    stops = float(sets.stream(seed, "overexposed").uniform(0.7, 1.6))
    return _with_effects("overexposed", {"exposure": stops}, "realistic", sets.make_scene(seed))


def _beside(name):
    """A listed cause that holds most of the error, beside one that no catalogue lists."""
    def make(seed):
        scene = sets.make_scene(seed)
        size = _unlisted_size(name, "strong", scene)
        truth = sets.Truth(f"exposure beside {name}", seed, "strong", {"exposure": 0.25}, unlisted=name, notes={"size": size})
        causes = unlisted.physics_of(name, size, scene)
        return sets.make_files(scene, truth, lambda number: dataclasses.replace(causes(number), exposure=0.25))

    return make


def _data_error(name):
    def make(seed):
        files = _nothing(seed)
        files.truth.arm = "data error " + name
        return data_errors.make(name, files, sets.stream(seed, "blunder"))

    return make


ARMS = (
    [Arm("nothing", "nothing", 100, _nothing), Arm("noise", "noise", 10, _noise)]
    + [Arm(f"weak {e}", "weak", 8, _one(e, "weak")) for e in strengths.EFFECTS]
    + [Arm(f"realistic {e}", "realistic", 8, _one(e, "realistic")) for e in strengths.EFFECTS]
    + [Arm("pair " + " + ".join(p), "pairs", 4, _pair(p)) for p in PAIRS]
    + [Arm(f"albedo {rms:g}", "albedo", 15, _albedo(rms, length)) for rms, length in ALBEDO]
    + [Arm(f"{s} {n}", "unlisted", 10, _unlisted(n, s)) for n in unlisted.NAMES for s in UNLISTED_SIGMAS]
    + [Arm("data error " + n, "data errors", 6, _data_error(n)) for n in data_errors.NAMES]
    + [Arm(f"realistic {e}", "realistic", 8, _one(e, "realistic")) for e in strengths.RESPONSES]
    + [Arm("overexposed", "realistic", 8, _overexposed)]
    + [Arm(f"exposure beside {n}", "unlisted", 6, _beside(n)) for n in ("dirt", "reflection")]
)


def seed_of(arm, number, range_name):
    """Of set `number` of an arm: no two sets of a range share one."""
    return SEEDS[range_name] + SETS_PER_ARM * ARMS.index(arm) + number
