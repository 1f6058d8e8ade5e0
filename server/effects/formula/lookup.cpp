// Lookup: a curve over one covariate that adds travel_mm or time_us to each finger.
//   added = v_n + (v_(n+1) - v_n) (x - x_n) / (x_(n+1) - x_n)  between the knots x_n and x_(n+1); constant beyond
// Linear between knots, because a person can read it off the file, it never overshoots what was measured, and the
// diagnosis fits values at knots: what it claims is exactly what is simulated.
// A finger without contact gets nothing. A covariate that is not finite is an error of the whole batch.
#include "server/effects/formula/lookup.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/effects/formula/pixel_variables.h"
#include "server/effects/formula/user_term.h"
#include "server/model/fields/user_term_fields.h"

namespace touchstone::effects {

// The catalogue's entry, which only describes; MakeLookupEffect makes effects that act.
model::Effect Lookup() {
  model::Effect effect;
  effect.name = "lookup";
  effect.stage = model::Stage::kMotion;
  effect.meaning =
      "A curve of your own, or one that a diagnosis found: it adds travel_mm or time_us to each finger, or "
      "grey to each pixel of a photograph, by the value of one covariate. It needs a name, a covariate, "
      "knots and values.";
  effect.signature =
      "What the curve shows. The diagnosis gives one where no built-in effect explains what depends on a "
      "covariate.";
  effect.check_on_rig = "Change the covariate alone and hold the rest: the error follows the curve.";
  effect.remedy = "Find the cause behind the curve; then give the cause a built-in effect, or remove it.";
  effect.apply = [](absl::Span<const double>, TouchBatch&) {};
  return effect;
}

double LookupValue(const model::LookupSpec& spec, int finger, double covariate) {
  const std::vector<double>& values = spec.values[spec.values.size() > 1 ? finger : 0];
  const auto above = std::upper_bound(spec.knots.begin(), spec.knots.end(), covariate);
  if (above == spec.knots.begin()) return values.front();
  if (above == spec.knots.end()) return values.back();
  const size_t n = static_cast<size_t>(above - spec.knots.begin());
  const double share = (covariate - spec.knots[n - 1]) / (spec.knots[n] - spec.knots[n - 1]);
  return values[n - 1] + (values[n] - values[n - 1]) * share;
}

namespace {

// Where the covariate of a lookup comes from.
struct LookupInput {
  model::LookupSpec spec;
  double (*read)(const TouchBatch&, int, int) = nullptr;  // null: a cov_* column, or
  double (*read_pixel)(const PhotoPixel&) = nullptr;      // of a photograph
};

void ApplyLookup(const LookupInput& input, TouchBatch& touches) {
  if (!touches.formula_error.empty()) return;
  const model::LookupSpec& spec = input.spec;
  const std::string title = absl::StrCat("lookup '", spec.name, "'");
  if (spec.values.size() > 1 && static_cast<int>(spec.values.size()) != touches.fingers()) {
    touches.formula_error = absl::StrCat(title, " has values for ", spec.values.size(),
                                         " fingers and the rig ", touches.fingers());
    return;
  }
  const double* column = nullptr;
  if (input.read == nullptr) {
    column = ColumnOf(spec.covariate, title, &touches);
    if (column == nullptr) return;
  }
  AddToFingers(spec, &touches, [&](int finger, int touch, double* added) {
    const double covariate = column != nullptr ? column[touch] : input.read(touches, finger, touch);
    if (!std::isfinite(covariate)) {
      touches.formula_error = absl::StrCat(title, ": ", spec.covariate, " is ", ShortestNumber(covariate),
                                           " for touch ", touches.index[touch], ", finger ", finger);
      return false;
    }
    *added = LookupValue(spec, finger, covariate);
    return true;
  });
}

absl::Status CheckCurve(const model::LookupSpec& spec) {
  const auto wrong = [](const auto&... parts) { return absl::InvalidArgumentError(absl::StrCat(parts...)); };
  if (spec.name.empty() || spec.name.size() > 64) return wrong("a name has 1 to 64 characters");
  TOUCHSTONE_RETURN_IF_ERROR(CheckAdds(spec));
  if (spec.knots.size() < 2 || spec.knots.size() > kMaxLookupKnots)
    return wrong("it has ", spec.knots.size(), " knots; it needs 2 to ", kMaxLookupKnots);
  for (size_t n = 0; n < spec.knots.size(); ++n)
    if (!std::isfinite(spec.knots[n]) || (n > 0 && !(spec.knots[n] > spec.knots[n - 1])))
      return wrong("knots must rise; knot ", n + 1, " is ", ShortestNumber(spec.knots[n]));
  if (spec.values.empty()) return wrong("it has no values");
  if (spec.adds_grey && spec.values.size() > 1)
    return wrong("it has values for ", spec.values.size(), " fingers; what adds grey needs one list");
  for (const std::vector<double>& values : spec.values) {
    if (values.size() != spec.knots.size())
      return wrong("it has ", spec.knots.size(), " knots and ", values.size(),
                   " values; each knot needs one");
    for (const double value : values)
      if (!std::isfinite(value)) return wrong("a value is ", ShortestNumber(value));
  }
  return absl::OkStatus();
}

absl::Status FindCovariate(LookupInput* input, model::EffectNeeds* needs) {
  const std::string& name = input->spec.covariate;
  if (input->spec.adds_grey) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const PixelVariable* pixel_variable, FindPixelInput("lookup", name, {}));
    input->read_pixel = pixel_variable->read;
    return absl::OkStatus();
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const FormulaVariable* variable, FindInput("lookup", input->spec, name, {}));
  if (variable != nullptr) input->read = variable->read;
  AddNeedsOf(name, needs);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::shared_ptr<const model::Effect>> MakeLookupEffect(const model::LookupSpec& spec) {
  auto input = std::make_shared<LookupInput>();
  input->spec = spec;
  auto effect = std::make_shared<model::Effect>(Lookup());
  absl::Status status = CheckCurve(spec);
  if (status.ok()) status = FindCovariate(input.get(), &effect->needs);
  if (!status.ok())
    return absl::InvalidArgumentError(absl::StrCat("lookup '", spec.name, "': ", status.message()));
  effect->stage = spec.stage;
  effect->lookup = std::make_shared<const model::LookupSpec>(spec);
  effect->meaning = absl::StrCat("Adds ", model::AddsName(spec), " by a curve of ", spec.covariate, ".");
  if (spec.adds_grey) {
    effect->apply = nullptr;
    effect->apply_to_photo = [input = std::shared_ptr<const LookupInput>(std::move(input))](
                                 absl::Span<const double>, PhotoSettings& photo) {
      photo.added_grey.push_back(
          [input](const PhotoPixel& pixel) { return LookupValue(input->spec, 0, input->read_pixel(pixel)); });
    };
    return std::shared_ptr<const model::Effect>(std::move(effect));
  }
  effect->apply = [input = std::shared_ptr<const LookupInput>(std::move(input))](
                      absl::Span<const double>, TouchBatch& touches) { ApplyLookup(*input, touches); };
  return std::shared_ptr<const model::Effect>(std::move(effect));
}

}  // namespace touchstone::effects
