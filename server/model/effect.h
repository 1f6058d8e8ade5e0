// An effect: one named physical cause with parameters that changes a touch in exactly one stage.
// The catalogue, the command line, the forms of the workbench, the fit's bounds and the documentation all
// read the same rows. This header is the interface; the physics stands in effects/, one file per effect.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <absl/types/span.h>

#include "server/base/units.h"

namespace touchstone {

class TouchBatch;  // effects/touch_batch.h

enum class Stage { kPose, kContact, kMotion, kSensor };
const char* StageName(Stage stage);  // "pose", ...

enum class Arity {
  kScalar,     // one number
  kVector3,    // x, y, z in the object frame
  kPerFinger,  // one number per finger, first to last
};

// One parameter. Numbers here are in the unit of files; values inside a model are SI.
struct ParameterInfo {
  std::string name;  // ends in the unit's suffix: "shift_mm"
  Unit unit = Unit::kNone;
  Arity arity = Arity::kScalar;
  double lower = 0;       // inclusive
  double upper = 0;       // inclusive
  double neutral = 0;     // the default: the value that changes nothing
  double typical = 0;     // the size that rigs show; the scale of the prior: neutral +- typical
  bool sum_zero = false;  // per finger: only differences between fingers can be seen, so the values sum to 0
  std::string meaning;

  int Count(int fingers) const {
    return arity == Arity::kScalar ? 1 : arity == Arity::kVector3 ? 3 : fingers;
  }
};

// What a simulation must provide beyond the ordinary for an effect to work.
struct EffectNeeds {
  bool previous_press = false;          // the press of the session's previous touch
  bool curvature = false;               // the surface's mean curvature at each contact
  std::vector<std::string> covariates;  // cov_* columns
};

// What a formula effect is made of, as the model file has it.
struct FormulaSpec {
  std::string name;
  bool adds_time = false;  // adds: time_us instead of travel_mm
  Stage stage = Stage::kMotion;
  std::string expression;  // in the units of files
  std::vector<ParameterInfo> parameters;
  std::vector<double> values;  // in the unit of files, one per parameter
};

struct Effect {
  std::string name;
  Stage stage = Stage::kPose;
  bool always_per_object = false;  // scope is always object (surface_error)
  bool before_cast =
      false;              // contact stage only: sets up the cast instead of changing its result (tip_radius)
  std::string meaning;    // what it is
  std::string signature;  // how it shows in the data, and what is told apart from it
  std::string check_on_rig;  // how to check it
  std::string remedy;        // how to remove it
  std::vector<ParameterInfo> parameters;
  EffectNeeds needs;
  std::shared_ptr<const FormulaSpec> formula;  // set for formulas only

  // Changes the batch in this effect's stage. `values` are SI, flat, in the order of `parameters`.
  std::function<void(absl::Span<const double> values, TouchBatch& batch)> apply;

  int ValueCount(int fingers) const;                     // of the flat array
  std::vector<double> NeutralValues(int fingers) const;  // SI
};

// The effects that a model file may name. effects/ implements it; model/ only asks.
class EffectCatalogue {
 public:
  virtual ~EffectCatalogue() = default;
  // By stage, in the order of application. The last, "formula", only describes: it has no parameters and changes
  // nothing.
  virtual std::vector<std::shared_ptr<const Effect>> All() const = 0;
  virtual std::shared_ptr<const Effect> Find(const std::string& name) const = 0;  // null if unknown
  // Checks and compiles a formula; the error names the place in the expression.
  virtual absl::StatusOr<std::shared_ptr<const Effect>> MakeFormula(const FormulaSpec& spec) const = 0;
};

}  // namespace touchstone
