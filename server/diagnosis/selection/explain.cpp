#include "server/diagnosis/selection/explain.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"

namespace touchstone {
namespace {

constexpr int kTermsFitted = 3;
constexpr int kMaxFormulaTerms = 2;
constexpr int kPasses = 3;
constexpr double kSameLikelihoodNats = 1;  // data that differ by less tell nothing

std::string FormulaName(const FormulaTerm& term) {
  std::string name = "rest_" + term.covariate;
  return name.substr(0, 60);
}

// The best fit with one more term of the dictionary, if it is worth its price.
struct WithTerm {
  bool found = false;
  FormulaTerm term;
  Explanation explanation;
};

// The index of the formula of this name among the effects that were added; -1: there is none.
int FindFormula(const Fit& fit, int given, const std::string& name) {
  for (int index = given; index < static_cast<int>(fit.model.base().effects.size()); ++index) {
    const Effect& effect = *fit.model.base().effects[index].effect;
    if (effect.formula != nullptr && effect.formula->name == name) return index;
  }
  return -1;
}

absl::StatusOr<WithTerm> TryTerms(const Study& study, const Search& search, const Explanation& without,
                                  const FormulaTerm* first) {
  const Experiment& experiment = study.experiment;
  WithTerm best;
  TOUCHSTONE_ASSIGN_OR_RETURN(const Prediction details,
                              study.searched_predictor->Run(without.fit.model.base(), true, true));
  const std::vector<FormulaTerm> terms = ScoreTerms(experiment, without.fit, details);
  const double price = search.rules().formula_nats;
  double best_evidence = without.fit.evidence + search.rules().enter_nats + price;
  int fitted = 0;
  for (const FormulaTerm& candidate : terms) {
    if (fitted++ == kTermsFitted || candidate.gain_nats < 0.5 * price) break;
    FormulaTerm term = candidate;
    FreeModel base = without.fit.model;
    if (first != nullptr) {
      // The second term joins the first in one expression.
      term = Sum(*first, candidate);
      const int at = FindFormula(without.fit, without.given, FormulaName(*first));
      if (at >= 0) base = base.Without(at);
      term.covariate = first->covariate;
    }
    const auto effect = MakeTermEffect(FormulaName(term), term);
    if (!effect.ok()) return effect.status();
    FreeModel start = base;
    start.Add(*effect, false);
    absl::StatusOr<Fit> fit = FitModel(experiment, std::move(start));
    if (!fit.ok() && fit.status().code() == absl::StatusCode::kCancelled) return fit.status();
    if (!fit.ok() || fit->evidence <= best_evidence) continue;
    const double gain = 1 - search.HeldoutRmse(*fit) / search.HeldoutRmse(without.fit);
    if (gain < search.rules().practical) continue;
    best_evidence = fit->evidence;
    best.found = true;
    best.term = term;
    best.explanation.fit = *std::move(fit);
    best.explanation.given = without.given;
  }
  return best;
}

// Effects of the catalogue first; what they leave may follow a formula; with the formula in place some of the
// effects may turn out to have stood in for it.
absl::Status FindCauses(const Study& study, Explained* explained) {
  const Search& search = *explained->search;
  const int given = static_cast<int>(study.input.model->effects.size());
  explained->given_effects = given;
  FreeModel base(*study.input.model, study.searched->objects);
  TOUCHSTONE_ASSIGN_OR_RETURN(explained->given, FitModel(study.experiment, base));
  TOUCHSTONE_ASSIGN_OR_RETURN(Explanation best, search.Run(base, given));
  explained->formula = -1;
  FormulaTerm* first = nullptr;
  for (int terms = 0; terms < kMaxFormulaTerms; ++terms) {
    TOUCHSTONE_ASSIGN_OR_RETURN(WithTerm with, TryTerms(study, search, best, first));
    if (!with.found) break;
    // From scratch, with the formula's term as one effect among the others.
    const auto effect = MakeTermEffect(FormulaName(with.term), with.term);
    if (!effect.ok()) return effect.status();
    FreeModel start = base;
    start.Add(*effect, false);
    TOUCHSTONE_ASSIGN_OR_RETURN(Explanation again, search.Run(start, given));
    const int at = FindFormula(again.fit, given, FormulaName(with.term));
    if (at >= 0 && again.fit.evidence > with.explanation.fit.evidence - 0.5) {
      best = std::move(again);
    } else {
      best = std::move(with.explanation);
    }
    explained->term = with.term;
    explained->formula = FindFormula(best.fit, given, FormulaName(with.term));
    first = &explained->term;
  }
  explained->fit = best.fit;
  explained->without_formula = best.fit;
  if (explained->formula >= 0) {
    TOUCHSTONE_ASSIGN_OR_RETURN(explained->without_formula,
                                FitModel(study.experiment, best.fit.model.Without(explained->formula)));
  }
  return absl::OkStatus();
}

absl::Status FindRivals(Explained* explained) {
  Explanation whole{explained->fit, explained->given_effects};
  const Search& search = *explained->search;
  for (int index = explained->given_effects;
       index < static_cast<int>(explained->fit.model.base().effects.size()); ++index) {
    if (index == explained->formula) continue;
    ExplainedStep step;
    step.effect = index;
    TOUCHSTONE_ASSIGN_OR_RETURN(const Fit without, search.WithoutEffect(whole, index));
    step.gain_nats = explained->fit.evidence - without.evidence;
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<Alternative> alternatives,
                                search.Alternatives(whole, index));
    const std::string own = NameOf(*explained->fit.model.base().effects[index].effect);
    double all = std::exp(-std::min(step.gain_nats, 700.0)), alike = 0;
    for (const Alternative& alternative : alternatives) {
      const double evidence = alternative.fit.evidence - explained->fit.evidence;
      const bool same = alternative.name == own;
      // Alike: as probable, or as likely with no more parameters, whatever rigs usually show.
      const bool equivalent =
          evidence > -search.rules().equivalent_nats ||
          (alternative.fit.log_likelihood > explained->fit.log_likelihood - kSameLikelihoodNats &&
           alternative.fit.model.size() <= explained->fit.model.size());
      all += std::exp(evidence);
      if (same || equivalent) alike += std::exp(evidence);
      if (same) continue;
      step.rivals.push_back(
          {alternative.name, alternative.per_object, evidence, equivalent, alternative.fit.model.base()});
    }
    step.probability = std::min(1.0, alike / all);
    explained->steps.push_back(std::move(step));
  }
  return absl::OkStatus();
}

}  // namespace

std::vector<double> ResidualsWithoutSurface(const Study& study, const Fit& fit) {
  const Contrasts& contrasts = *study.contrasts;
  const Observations& o = *study.searched;
  const Eigen::VectorXd left = fit.columns.values.col(0) -
                               study.likelihood->FieldMean(Likelihood::Pick(fit.columns, {0}), fit.surface);
  std::vector<double> residuals(o.time_s.size(), NAN);
  for (size_t t = 0; t < contrasts.touches().size(); ++t) {
    const Eigen::MatrixXd& h = contrasts.MatrixOf(static_cast<int>(t));
    const int first = contrasts.FirstRow(static_cast<int>(t));
    for (int i = 0; i < o.fingers; ++i) {
      if (!contrasts.TakesPart(static_cast<int>(t), i)) continue;
      double sum = 0;
      for (int row = 0; row < h.rows(); ++row) sum += h(row, i) * left[first + row];
      residuals[static_cast<size_t>(contrasts.touches()[t]) * o.fingers + i] =
          sum / contrasts.root_weights()[t];
    }
  }
  return residuals;
}

double SurfaceEvidence(const Study& study, const Fit& fit) {
  std::vector<int> members(fit.model.size() + 1);
  for (int i = 0; i <= fit.model.size(); ++i) members[i] = i;
  const std::vector<Eigen::MatrixXd> grams = {study.likelihood->Gram(fit.columns, 0)};
  const double none = Judge(*study.likelihood, grams, members, fit.model.coordinates(), fit.point).evidence;
  const double excess = fit.evidence - none;  // log of (none + some) / none
  return excess > 30 ? excess : std::log(std::max(std::expm1(excess), 1e-12));
}

absl::StatusOr<Explained> Explain(Study* study) {
  Explained explained;
  std::vector<double> weights;
  // The share that is done stays where the caller has put it.
  const auto progress = [study](const std::string& what) {
    if (study->context.progress) study->context.progress(what, 0);
  };
  for (int pass = 0; pass < kPasses; ++pass) {
    TOUCHSTONE_RETURN_IF_ERROR(PrepareSearch(study, weights));
    explained = Explained();
    explained.search =
        std::make_unique<Search>(study->experiment, MakeCandidates(study->input), SearchRules(), progress);
    TOUCHSTONE_RETURN_IF_ERROR(FindCauses(*study, &explained));

    // The noise of what is left, on all touches.
    Observations& o = *study->observations;
    TOUCHSTONE_ASSIGN_OR_RETURN(const Prediction details,
                                study->predictor->Run(explained.fit.model.base(), true, false));
    std::vector<double> residuals =
        study->thinned ? Residuals(o, details) : ResidualsWithoutSurface(*study, explained.fit);
    std::vector<double> tangents(residuals.size());
    std::vector<char> expected(residuals.size());
    // A finger that would have had farther to go than any that reported is beyond the rig's stroke.
    double farthest_m = 0;
    for (size_t e = 0; e < residuals.size(); ++e)
      if (!std::isnan(o.time_s[e]) && details.travel_m[e] > farthest_m) farthest_m = details.travel_m[e];
    for (size_t e = 0; e < residuals.size(); ++e) {
      const double cosine = std::clamp(details.cos_incidence[e], 0.05, 1.0);
      tangents[e] = std::sqrt(1 / (cosine * cosine) - 1);
      expected[e] = !std::isnan(details.time_s[e]) && details.travel_m[e] <= farthest_m;
    }
    explained.noise =
        FindNoise(o, residuals, tangents, expected,
                  explained.fit.model.size() +
                      (study->thinned ? 0 : study->likelihood->surfaces()[explained.fit.surface].degrees));

    // Where the better model says that a finger all but misses an edge, outliers, touches of little worth:
    // they leave or count less, then everything once more.
    if (pass + 1 == kPasses) break;
    TOUCHSTONE_ASSIGN_OR_RETURN(const int edges,
                                LeaveOutEdges(*study->predictor, explained.fit.model.base(), &o));
    const bool reweigh = weights.empty() && !explained.noise.weights.empty();
    if (edges == 0 && explained.noise.outliers.empty() && !reweigh) break;
    for (const int k : explained.noise.outliers)
      LeaveOut(&o, k, "an outlier: one finger's time is far from what all other touches allow");
    weights.clear();
    if (!explained.noise.weights.empty()) {
      weights.assign(o.set->size(), 1.0);
      for (int k = 0; k < o.size(); ++k) weights[o.row[k]] = explained.noise.weights[k];
    }
  }
  TOUCHSTONE_RETURN_IF_ERROR(FindRivals(&explained));
  if (explained.formula >= 0) {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const Prediction details,
        study->searched_predictor->Run(explained.without_formula.model.base(), true, true));
    explained.terms = ScoreTerms(study->experiment, explained.without_formula, details);
  }

  explained.surface_nats = SurfaceEvidence(*study, explained.fit);
  const Likelihood::Surface& surface = study->likelihood->surfaces()[explained.fit.surface];
  explained.surface_rms_m = surface.ratio_m_s * explained.fit.sigma_s;
  explained.surface_length_m = surface.length_m;
  explained.surface_degrees = surface.degrees;
  return explained;
}

}  // namespace touchstone
