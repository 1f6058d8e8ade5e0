// The shape of an effect's file: a struct of SI parameters, a row for each (what files call it, its unit,
// bounds and meaning), the texts for people, and a function that changes the batch (or the photograph's settings) in the effect's stage.
// DefineEffect turns them into the table that the catalogue, files, forms and fits read. See README.md.
#pragma once

#include <array>
#include <cmath>
#include <string>
#include <variant>
#include <vector>

#include <absl/strings/str_split.h>
#include <absl/types/span.h>
#include <Eigen/Core>

#include "server/base/check.h"
#include "server/effects/photo_settings.h"
#include "server/effects/touch_batch.h"
#include "server/model/effect.h"
#include "server/model/model.h"

namespace touchstone::effects {

// A parameter with one value per finger; entries from the batch's number of fingers on are zero.
using PerFinger = std::array<double, model::kMaxFingers>;

// One parameter of an effect whose values live in the struct P. Numbers here are in the unit of files;
// the field gets SI. The kind of field (one number, a vector, one number per finger) follows from its type.
template <typename P>
struct ParameterRow {
  std::variant<double P::*, Eigen::Vector3d P::*, Eigen::Vector2d P::*, PerFinger P::*> field;
  const char* name;  // with the unit's suffix
  Unit unit;
  double lower;
  double upper;
  double neutral;  // changes nothing; the default
  double typical;  // the size that rigs show
  const char* meaning;
  bool sum_zero = false;     // per finger: only differences can be seen, so the values sum to 0
  bool reciprocal = false;   // the response is smooth in 1 / value, and infinity stands for "none"
  double usual = 0;          // the largest magnitude that rigs show; 0: up to the bounds
  const char* choices = "";  // ParameterInfo::choices, with commas between
  double least_claimed = -INFINITY;
};

template <typename P>
struct EffectDefinition {
  const char* name;
  model::Stage stage;
  model::EffectRole role = model::EffectRole::kSystematic;
  bool always_per_object = false;
  bool often_per_object = false;
  bool before_cast = false;
  bool moves_surface = false;
  const char* meaning;
  const char* signature;
  const char* check_on_rig;
  const char* remedy;
  std::vector<model::ConfoundedEffect> confounded_with = {};
  absl::Span<const ParameterRow<P>> rows;
  model::EffectNeeds needs = {};
  // One of the two, as the stage asks for.
  void (*apply)(const P& parameters, TouchBatch& touches) = nullptr;
  void (*apply_to_photo)(const P& parameters, PhotoSettings& photo) = nullptr;
};

namespace define_effect_internal {

// Copies a flat array of SI values into the fields of P, in the order of the rows. Not inlined: there GCC 12
// warns of branches that the type of the field rules out.
template <typename P>
[[gnu::noinline]] void Unpack(absl::Span<const ParameterRow<P>> rows, absl::Span<const double> values,
                              int fingers, P* parameters) {
  size_t next = 0;
  for (const ParameterRow<P>& row : rows) {
    if (const auto* scalar = std::get_if<double P::*>(&row.field)) {
      parameters->*(*scalar) = values.at(next++);
    } else if (const auto* vector = std::get_if<Eigen::Vector3d P::*>(&row.field)) {
      for (int axis = 0; axis < 3; ++axis) (parameters->*(*vector))[axis] = values.at(next++);
    } else if (const auto* pair = std::get_if<Eigen::Vector2d P::*>(&row.field)) {
      for (int axis = 0; axis < 2; ++axis) (parameters->*(*pair))[axis] = values.at(next++);
    } else {
      PerFinger& entries = parameters->*(std::get<PerFinger P::*>(row.field));
      for (int finger = 0; finger < model::kMaxFingers; ++finger)
        entries[finger] = finger < fingers ? values.at(next++) : 0.0;
    }
  }
  TOUCHSTONE_CHECK(next == values.size());
}

}  // namespace define_effect_internal

template <typename P>
model::Effect DefineEffect(const EffectDefinition<P>& definition) {
  model::Effect effect;
  effect.name = definition.name;
  effect.stage = definition.stage;
  effect.role = definition.role;
  effect.always_per_object = definition.always_per_object;
  effect.often_per_object = definition.often_per_object;
  effect.before_cast = definition.before_cast;
  effect.moves_surface = definition.moves_surface;
  effect.meaning = definition.meaning;
  effect.signature = definition.signature;
  effect.check_on_rig = definition.check_on_rig;
  effect.remedy = definition.remedy;
  effect.confounded_with = definition.confounded_with;
  effect.needs = definition.needs;
  for (const ParameterRow<P>& row : definition.rows) {
    model::ParameterInfo info;
    info.name = row.name;
    info.unit = row.unit;
    info.arity = std::holds_alternative<double P::*>(row.field)            ? model::Arity::kScalar
                 : std::holds_alternative<Eigen::Vector3d P::*>(row.field) ? model::Arity::kVector3
                 : std::holds_alternative<Eigen::Vector2d P::*>(row.field) ? model::Arity::kVector2
                                                                           : model::Arity::kPerFinger;
    info.lower = row.lower;
    info.upper = row.upper;
    if (row.usual > 0) info.usual_lower = -row.usual, info.usual_upper = row.usual;
    info.neutral = row.neutral;
    info.typical = row.typical;
    info.sum_zero = row.sum_zero;
    info.reciprocal = row.reciprocal;
    info.meaning = row.meaning;
    info.least_claimed = row.least_claimed;
    if (*row.choices != 0) info.choices = absl::StrSplit(row.choices, ',');
    effect.parameters.push_back(std::move(info));
  }
  // The span points to the static rows of the effect's file.
  TOUCHSTONE_CHECK((definition.apply_to_photo != nullptr) == effect.of_photos());
  TOUCHSTONE_CHECK((definition.apply != nullptr) != effect.of_photos());
  if (effect.of_photos()) {
    effect.apply_to_photo = [rows = definition.rows, apply = definition.apply_to_photo](
                                absl::Span<const double> values, PhotoSettings& photo) {
      P parameters{};
      define_effect_internal::Unpack<P>(rows, values, 0, &parameters);
      apply(parameters, photo);
    };
    return effect;
  }
  effect.apply = [rows = definition.rows, apply = definition.apply](absl::Span<const double> values,
                                                                    TouchBatch& touches) {
    P parameters{};
    define_effect_internal::Unpack<P>(rows, values, touches.fingers(), &parameters);
    apply(parameters, touches);
  };
  return effect;
}

}  // namespace touchstone::effects
