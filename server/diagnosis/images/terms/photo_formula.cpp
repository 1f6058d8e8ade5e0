#include "server/diagnosis/images/terms/photo_formula.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "server/base/status.h"
#include "server/diagnosis/engine/ladder/ladder.h"
#include "server/diagnosis/images/rules.h"
#include "server/diagnosis/images/terms/photo_rest_sums.h"
#include "server/diagnosis/images/terms/photo_term_scores.h"
#include "server/diagnosis/images/terms/photo_terms.h"
#include "server/diagnosis/images/terms/rules.h"
#include "server/effects/formula/lookup.h"

namespace touchstone::diagnosis::images {
namespace {

absl::StatusOr<std::shared_ptr<const model::Effect>> MakeCurve(const CurveAxis& axis, const AxisRange& range,
                                                               const Eigen::VectorXd& values) {
  model::LookupSpec spec;
  spec.name = absl::StrCat("rest_", axis.name);
  spec.adds_grey = true;
  spec.stage = model::Stage::kImageSensor;
  spec.covariate = axis.name;
  spec.values.resize(1);
  const auto short_number = [](double value) {
    return std::strtod(absl::StrFormat("%.4g", value).c_str(), nullptr);
  };
  for (int n = 0; n < kPhotoTermRules.curve_knots; ++n) {
    spec.knots.push_back(
        short_number(range.low + (range.high - range.low) * n / (kPhotoTermRules.curve_knots - 1)));
    spec.values[0].push_back(short_number(values[n]));
  }
  return effects::MakeLookupEffect(spec);
}

class RestSearch {
 public:
  RestSearch(const Photographs& photographs, const model::Model& model, const RestErrors& errors,
             ThreadPool* pool)
      : photographs_(photographs), model_(model), errors_(errors), pool_(pool) {}

  // Whether chance hardly brings it about and what it was not fitted to bears it out.
  static bool Holds(const TermScore& score, double paid_nats, double tries, double nameless) {
    return score.determined && score.gain_nats - paid_nats > kPhotoTermRules.enter_nats &&
           score.p * tries < kImageRules.rest_p && score.every_object &&
           score.taken_unseen > kPhotoTermRules.min_held * score.taken &&
           score.taken_unseen > kPhotoTermRules.of_nameless * nameless;
  }

  // The errors with the effect as comparisons find them; none where it takes too little.
  absl::StatusOr<std::optional<RestSuggestion>> Try(const std::shared_ptr<const model::Effect>& effect,
                                                    const TermScore& score) const {
    const std::optional<RestSuggestion> none;
    model::Model with = model_;
    model::EffectInstance instance;
    instance.effect = effect;
    instance.values = effect->NeutralValues(with.fingers);
    with.effects.push_back(instance);
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<image::Photo> expected,
                                ExpectPhotographs(photographs_, with, false, pool_));
    RestSuggestion tried;
    tried.rmse = RmseGrey(photographs_, expected);
    const double fallen = std::pow(errors_.rmse_grey, 2) - std::pow(tried.rmse, 2);
    const double held = std::min(score.taken_unseen / std::max(score.taken, 1e-300), 1.0);
    const double before2 = std::pow(errors_.heldout_rmse_grey, 2), floor2 = std::pow(errors_.floor_grey, 2);
    const double after2 = std::max(before2 - fallen * held, std::pow(tried.rmse, 2));
    if (!(before2 > floor2)) return none;
    tried.heldout_rmse = std::sqrt(after2);
    tried.heldout_gain = std::clamp((before2 - after2) / (before2 - floor2), 0.0, 1.0);
    if (tried.heldout_gain < kPhotoTermRules.min_excess) return none;
    model::Model only = model_;
    const std::string yaml = engine::EffectYaml(only, std::move(instance));
    (effect->formula != nullptr ? tried.formula_yaml : tried.lookup_yaml) = yaml;
    if (effect->formula != nullptr) tried.formula = effect->formula->expression;
    tried.model_with = std::move(with);
    return std::optional<RestSuggestion>(std::move(tried));
  }

 private:
  const Photographs& photographs_;
  const model::Model& model_;
  const RestErrors& errors_;
  ThreadPool* pool_;
};

}  // namespace

absl::StatusOr<std::optional<RestSuggestion>> SuggestForRest(const Photographs& photographs,
                                                             const Photographs& judged,
                                                             const model::Model& model,
                                                             const RestErrors& errors, ThreadPool* pool) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<image::Photo> expected,
                              ExpectPhotographs(judged, model, true, pool));
  const PhotoTermDictionary dictionary = MakePhotoTerms(judged);
  const RestSums sums(judged, model, expected, dictionary, pool);
  const double nameless = sums.Nameless();
  const double tries = static_cast<double>(dictionary.terms.size() + kCurveAxisCount);
  const RestSearch search(photographs, model, errors, pool);

  std::optional<RestSuggestion> curve;
  for (size_t axis = 0; axis < kCurveAxisCount; ++axis) {
    if (!sums.ranges()[axis].usable()) continue;
    const TermScore score = sums.ScoreCurve(axis);
    const double paid = std::log(static_cast<double>(kCurveAxisCount * kCurveBends));
    if (!RestSearch::Holds(score, paid, tries, nameless)) continue;
    TOUCHSTONE_ASSIGN_OR_RETURN(const auto effect,
                                MakeCurve(kCurveAxes[axis], sums.ranges()[axis], score.values));
    TOUCHSTONE_ASSIGN_OR_RETURN(std::optional<RestSuggestion> tried, search.Try(effect, score));
    if (!tried || (curve && tried->heldout_gain <= curve->heldout_gain)) continue;
    tried->follows = {kCurveAxes[axis].name, std::min(score.p * tries, 1.0), score.gain_nats - paid};
    curve = std::move(tried);
  }
  std::vector<std::pair<double, size_t>> order;  // gain beyond what is paid, term
  std::vector<TermScore> scores;
  for (size_t t = 0; t < dictionary.terms.size(); ++t) {
    scores.push_back(sums.ScoreTerm(t));
    const double paid = kPhotoTermRules.picked_nats + dictionary.terms[t].penalty_nats;
    if (RestSearch::Holds(scores[t], paid, tries, nameless))
      order.emplace_back(scores[t].gain_nats - paid, t);
  }
  std::stable_sort(order.begin(), order.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  std::optional<RestSuggestion> formula;
  for (size_t n = 0; n < std::min(order.size(), kPhotoTermRules.max_tried.value()); ++n) {
    const size_t t = order[n].second;
    const TermScore& score = scores[t];
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const auto effect,
        MakePhotoTermEffect(
            dictionary.terms[t],
            std::vector<double>(score.values.data(), score.values.data() + score.values.size())));
    TOUCHSTONE_ASSIGN_OR_RETURN(std::optional<RestSuggestion> tried, search.Try(effect, score));
    if (!tried || (formula && tried->heldout_gain <= formula->heldout_gain)) continue;
    tried->follows = {dictionary.terms[t].covariate, std::min(score.p * tries, 1.0), order[n].first};
    formula = std::move(tried);
  }
  return formula &&
                 (!curve || formula->heldout_gain >= kPhotoTermRules.formula_of_curve * curve->heldout_gain)
             ? formula
             : curve;
}

}  // namespace touchstone::diagnosis::images
