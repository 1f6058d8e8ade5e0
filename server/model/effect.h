// An effect: one named physical cause with parameters that changes a touch or a photograph in exactly one stage.
// The catalogue, the command line, the forms of the workbench, the fit's bounds and the documentation all
// read the same rows. This header is the interface; the physics stands in effects/, one file per effect.
#pragma once

#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <absl/types/span.h>

#include "server/base/units.h"

namespace touchstone::effects {
class TouchBatch;
struct PhotoSettings;
}  // namespace touchstone::effects

namespace touchstone::model {

// Of a touch the first four, of a photograph the others, each in the order in which they run.
enum class Stage {
  kPose,
  kContact,
  kMotion,
  kSensor,
  kCameraPose,
  kProjection,
  kShading,
  kImageSensor,
};
const char* StageName(Stage stage);  // "pose", ..., "camera pose", ...
inline bool IsPhotoStage(Stage stage) {
  return stage >= Stage::kCameraPose;
}

enum class Arity {
  kScalar,     // one number
  kVector3,    // x, y, z; in the object frame unless the parameter's meaning names another
  kVector2,    // x, y in the image: right and down
  kPerFinger,  // one number per finger, first to last
};

// One parameter. Numbers here are in the unit of files; values inside a model are SI.
struct ParameterInfo {
  std::string name;  // ends in the unit's suffix: "shift_mm"
  Unit unit = Unit::kNone;
  Arity arity = Arity::kScalar;
  double lower = 0;    // inclusive
  double upper = 0;    // inclusive
  double neutral = 0;  // the default: the value that changes nothing
  double typical = 0;  // the size that rigs show; the scale of the prior: neutral +- typical
  // What rigs show, within the bounds: a value beyond it is simulated, but a diagnosis that finds one asks for a look at
  // the set-up.
  double usual_lower = -INFINITY;
  double usual_upper = INFINITY;
  double least_claimed = -INFINITY;  // less is simulated, and is no cause that a diagnosis adds
  bool sum_zero = false;  // per finger: only differences between fingers can be seen, so the values sum to 0
  bool reciprocal = false;  // the response is smooth in 1 / value: a fit moves that, and "none" is infinity
  // Names of the values 0, 1, ..., which files write; other values are those of fits alone. Empty: any number.
  std::vector<std::string> choices = {};
  std::string meaning;

  int Count(int fingers) const {
    switch (arity) {
      case Arity::kScalar:
        return 1;
      case Arity::kVector3:
        return 3;
      case Arity::kVector2:
        return 2;
      case Arity::kPerFinger:
        break;
    }
    return fingers;
  }
};

// What an effect does to the data: to their expectation, or to one property of their scatter. A diagnosis fits
// systematic effects and judges each of the others by the likelihood of what the best explanation leaves.
enum class EffectRole {
  kSystematic,     // changes the expected times
  kNoiseLevel,     // standard deviation of one reading
  kNoiseGrowth,    // growth of the noise with the incidence
  kNoiseTails,     // degrees of freedom of heavy tails
  kQuantisation,   // readings fall on ticks
  kDropout,        // readings are missing
  kNoiseMemory,    // correlated in session time, each finger on its own
  kNoiseOfLength,  // standard deviation of where a finger triggers: in time it grows as the speed falls
  kNoiseByFinger,  // what a finger's noise has beyond the others'
  kSmoothError,    // a smooth error of the surface, drawn anew for every object
  kPixelNoise,     // of a photograph's pixels
};

// Another effect that may explain the same data, and what tells the two apart.
struct ConfoundedEffect {
  std::string effect;                      // its name; empty: whatever else it may be
  std::string discriminating_measurement;  // a sentence for people
};

// What a simulation must provide beyond the ordinary for an effect to work.
struct EffectNeeds {
  bool previous_press = false;               // the press of the session's previous touch
  bool curvature = false;                    // the surface's mean curvature at each contact
  bool session_time = false;                 // session_time_s: repeats of a touch differ
  std::vector<std::string> covariates = {};  // cov_* columns
};

// What formulas and lookups have in common, as the model file has it: they add something to each finger.
struct UserTerm {
  std::string name;
  bool adds_time = false;  // adds: time_us instead of travel_mm
  Stage stage = Stage::kMotion;
  bool adds_grey = false;  // adds: grey, to every pixel of a photograph; the stage is kImageSensor
};

// What a formula effect is made of.
struct FormulaSpec : UserTerm {
  std::string expression;  // in the units of files
  std::vector<ParameterInfo> parameters;
  std::vector<double> values;  // in the unit of files, one per parameter
};

// What a lookup effect is made of: a curve over one covariate, linear between its knots and constant beyond them.
struct LookupSpec : UserTerm {
  std::string covariate;      // a variable of formulas or a cov_* column
  std::vector<double> knots;  // rising, in the covariate's unit
  std::vector<std::vector<double>>
      values;  // mm or us at the knots: one list for every finger, or one per finger
};

// How one object's surface departs from its mesh, in the units of the map's file (surface_map.md).
struct SurfaceMapPoint {
  std::array<double, 3> position_mm{};  // in the frame of the mesh file
  double departure_mm = 0;              // along the outward normal
  double std_dev_mm = 0;
};
struct SurfaceMapObject {
  double length_mm = 0,
         rms_mm = 0;  // of the departures: correlation length, size before anything is measured
  std::vector<SurfaceMapPoint> points;
};

// What a surface map is made of.
struct SurfaceMapSpec {
  std::string file;                                 // as the model file names it
  std::map<std::string, SurfaceMapObject> objects;  // by name
};

struct Effect {
  std::string name;
  Stage stage = Stage::kPose;
  EffectRole role = EffectRole::kSystematic;
  bool always_per_object = false;  // scope is always object (surface_error)
  bool often_per_object = false;   // a diagnosis also tries values that differ from object to object
  bool before_cast =
      false;  // contact stage only: sets up the cast instead of changing its result (tip_radius)
  bool moves_surface = false;  // pose stage only: photographs of the object show it too
  std::string meaning;         // what it is
  std::string signature;       // how it shows in the data, and what is told apart from it
  std::string check_on_rig;    // how to check it
  std::string remedy;          // how to remove it
  std::vector<ParameterInfo> parameters;
  std::vector<ConfoundedEffect> confounded_with;  // each pair is declared by one of the two
  EffectNeeds needs;
  std::shared_ptr<const FormulaSpec> formula;         // set for formulas only
  std::shared_ptr<const LookupSpec> lookup;           // set for lookups only
  std::shared_ptr<const SurfaceMapSpec> surface_map;  // set for surface maps only

  // Changes the batch in this effect's stage. `values` are SI, flat, in the order of `parameters`.
  std::function<void(absl::Span<const double> values, effects::TouchBatch& batch)> apply;
  // The same of an effect of a photograph's stages; each effect has one of the two.
  std::function<void(absl::Span<const double> values, effects::PhotoSettings& photo)> apply_to_photo;

  bool of_photos() const { return IsPhotoStage(stage); }

  // Its draws differ from touch to touch or from object to object: it changes no expectation.
  bool random() const { return role != EffectRole::kSystematic; }
  int ValueCount(int fingers) const;                     // of the flat array
  std::vector<double> NeutralValues(int fingers) const;  // SI
};

// The effects that a model file may name. effects/ implements it; model/ only asks.
class EffectCatalogue {
 public:
  virtual ~EffectCatalogue() = default;
  // By stage, in the order of application. "surface_map" and the last two, "formula" and "lookup", only describe:
  // they have no parameters and change nothing.
  virtual std::vector<std::shared_ptr<const Effect>> All() const = 0;
  virtual std::shared_ptr<const Effect> Find(const std::string& name) const = 0;  // null if unknown
  // Checks and compiles a formula; the error names the place in the expression.
  virtual absl::StatusOr<std::shared_ptr<const Effect>> MakeFormula(const FormulaSpec& spec) const = 0;
  // Checks a curve; the error names the field.
  virtual absl::StatusOr<std::shared_ptr<const Effect>> MakeLookup(const LookupSpec& spec) const = 0;
  // Makes a map of departures that were read from its file act.
  virtual absl::StatusOr<std::shared_ptr<const Effect>> MakeSurfaceMap(const SurfaceMapSpec& spec) const = 0;
};

}  // namespace touchstone::model
