#include "server/diagnosis/selection/ladder.h"

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/effects/all_effects.h"
#include "server/model/parameter_values.h"

namespace touchstone {
namespace {

constexpr double kSurfaceNats = 5;        // evidence that makes a surface error a step by itself
constexpr double kSurfaceWithMisfit = 1;  // ... and where the lack of fit says that something is left
constexpr double kMisfitP = 1e-2;
constexpr double kUnexplainedP = 1e-4;      // of the lack of fit, for a rest without a name
constexpr double kUnexplainedShare = 0.01;  // of the floor that such a rest must add

// The fit on every touch, where the search saw a part of them and no surface error stands in the way.
absl::StatusOr<Fit> FitAll(Study* study, const Fit& fit) {
  if (!study->thinned || fit.surface != 0 || fit.model.size() == 0) return fit;
  const Observations& o = *study->observations;
  Contrasts contrasts(o, study->nominal.time_s);
  const Likelihood likelihood(o, contrasts, study->nominal, false, 0, nullptr);
  Experiment all = study->experiment;
  all.observations = &o;
  all.predictor = study->predictor.get();
  all.contrasts = &contrasts;
  all.likelihood = &likelihood;
  all.nominal_s = study->nominal.time_s;
  all.pool = nullptr;  // the predictor has the threads
  TOUCHSTONE_ASSIGN_OR_RETURN(Fit whole, FitModel(all, fit.model));
  whole.columns = fit.columns;  // held-out errors come from the search's touches
  return whole;
}

FreeModel Only(const FreeModel& model, int given, const std::vector<int>& kept) {
  FreeModel part = model;
  for (int index = static_cast<int>(model.base().effects.size()) - 1; index >= given; --index)
    if (std::find(kept.begin(), kept.end(), index) == kept.end()) part = part.Without(index);
  return part;
}

void TellEffect(const Effect& effect, v1::Step* step) {
  step->set_meaning(effect.meaning);
  step->set_check_on_rig(effect.check_on_rig);
  step->set_remedy(effect.remedy);
}

void DescribeRefits(const Model& before, const Fit& fit, Ladder* ladder, v1::Report* report) {
  for (int index = 0; index < static_cast<int>(before.effects.size()); ++index) {
    if (!fit.model.IsFree(index)) continue;
    v1::Refit* refit = report->add_refitted();
    refit->set_effect(NameOf(*before.effects[index].effect));
    FreeModel given(before, report->data().objects_size() > 0
                                ? std::vector<std::string>(report->data().objects().begin(),
                                                           report->data().objects().end())
                                : std::vector<std::string>());
    const std::vector<v1::ParameterValue> old = given.Describe(index, Eigen::VectorXd(), Eigen::MatrixXd());
    std::vector<v1::ParameterValue> now = fit.model.Describe(index, fit.point, fit.covariance);
    for (size_t j = 0; j < now.size(); ++j) {
      if (j < old.size()) now[j].set_before(old[j].value());
      *refit->add_parameters() = std::move(now[j]);
    }
    ladder->values_wrong = true;
    ladder->changed = true;
  }
}

// Fitted values without digits that mean nothing.
void RoundValues(const Fit& fit, Model* model) {
  for (int index = 0; index < static_cast<int>(model->effects.size()); ++index) {
    if (!fit.model.IsFree(index)) continue;
    EffectInstance& instance = model->effects[index];
    for (const v1::ParameterValue& value : fit.model.Describe(index, fit.point, fit.covariance)) {
      for (int p = 0; p < static_cast<int>(instance.effect->parameters.size()); ++p) {
        const ParameterInfo& parameter = instance.effect->parameters[p];
        if (parameter.name != value.name()) continue;
        std::vector<double>& values =
            value.object().empty() ? instance.values : instance.object_values.at(value.object());
        for (int j = 0; j < parameter.Count(model->fingers); ++j) {
          if (EntryName(parameter, j, model->fingers) != value.finger()) continue;
          const double rounded = RoundedTo(value.value(), value.std_error());
          if (rounded >= parameter.lower && rounded <= parameter.upper)
            values[ValueOffset(*instance.effect, p, model->fingers) + j] = ToSi(parameter.unit, rounded);
          // The last of values that sum to zero is what the others leave.
          const int last = parameter.Count(model->fingers) - 1;
          if (!parameter.sum_zero || j != last) continue;
          double sum = 0;
          for (int i = 0; i < last; ++i) sum += values[ValueOffset(*instance.effect, p, model->fingers) + i];
          values[ValueOffset(*instance.effect, p, model->fingers) + last] = -sum;
        }
      }
    }
  }
}

}  // namespace

double RoundedTo(double value, double std_error) {
  if (!(std_error > 0) || !std::isfinite(std_error) || value == 0) return value;
  const double digit = std::pow(10.0, std::floor(std::log10(std_error)) - 2);
  // A power of ten is exact upwards only.
  return digit >= 1 ? std::round(value / digit) * digit : std::round(value / digit) / std::round(1 / digit);
}

absl::StatusOr<Ladder> BuildLadder(Study* study, const Explained& explained, v1::Report* report) {
  const Observations& o = *study->observations;
  const Search& search = *explained.search;
  const int given = explained.given_effects;
  Ladder ladder;

  // The improved model: everything but the formula.
  Fit fit = explained.fit;
  TOUCHSTONE_ASSIGN_OR_RETURN(fit, FitAll(study, fit));
  Model whole = fit.model.base();
  RoundValues(fit, &whole);
  ladder.improved = whole;
  if (explained.formula >= 0)
    ladder.improved.effects.erase(ladder.improved.effects.begin() + explained.formula);
  ladder.changed = !explained.steps.empty();
  TOUCHSTONE_ASSIGN_OR_RETURN(ladder.prediction, study->predictor->Run(ladder.improved, true, true));
  ladder.residuals = Residuals(o, ladder.prediction);
  std::vector<double> best = ladder.residuals;
  if (explained.formula >= 0) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const Prediction with, study->predictor->Run(whole, false, false));
    best = Residuals(o, with);
  }
  *report->mutable_noise_floor() = NoiseFloorOf(o, best, fit.model.size());
  report->set_noise_floor_us(report->noise_floor().sigma_us());

  // Refits.
  DescribeRefits(*study->input.model, fit, &ladder, report);

  // Steps in the order in which they explain most.
  std::vector<int> kept, open;
  for (const ExplainedStep& step : explained.steps) open.push_back(step.effect);
  while (!open.empty()) {
    absl::StatusOr<Fit> next = absl::NotFoundError("");
    size_t chosen = 0;
    for (size_t j = 0; j < open.size(); ++j) {
      std::vector<int> with = kept;
      with.push_back(open[j]);
      absl::StatusOr<Fit> trial = absl::NotFoundError("");
      if (open.size() == 1 && explained.formula < 0) {
        trial = explained.fit;
      } else {
        trial = FitModel(study->experiment, Only(explained.fit.model, given, with));
        if (!trial.ok()) return trial.status();
      }
      if (next.ok() && trial->evidence <= next->evidence) continue;
      next = std::move(trial);
      chosen = j;
    }
    kept.push_back(open[chosen]);
    open.erase(open.begin() + static_cast<long>(chosen));
    const int index = kept.back();
    const ExplainedStep& from = *std::find_if(explained.steps.begin(), explained.steps.end(),
                                              [&](const ExplainedStep& s) { return s.effect == index; });
    v1::Step* step = report->add_steps();
    const EffectInstance& instance = fit.model.base().effects[index];
    step->set_effect(NameOf(*instance.effect));
    step->set_scope(instance.per_object ? "object" : "rig");
    TellEffect(*instance.effect, step);
    step->set_probability(from.probability);
    step->set_gain_nats(from.gain_nats);
    for (v1::ParameterValue& value : fit.model.Describe(index, fit.point, fit.covariance))
      *step->add_parameters() = std::move(value);
    std::vector<std::string> alike = {step->effect()};
    for (const Rival& rival : from.rivals)
      if (rival.equivalent && std::find(alike.begin(), alike.end(), rival.name) == alike.end()) {
        step->add_equivalent(rival.name);
        alike.push_back(rival.name);
      }
    if (alike.size() > 1) {
      step->set_decided_by(DecidedBy(alike));
      v1::Ambiguity* ambiguity = report->add_ambiguities();
      for (const std::string& name : alike) ambiguity->add_effects(name);
      ambiguity->set_decided_by(step->decided_by());
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(const Prediction prediction,
                                study->predictor->Run(next->model.base(), false, false));
    const v1::Quality quality = QualityOf(*study, search, *next, Residuals(o, prediction), false);
    step->set_rmse_us(quality.rmse_us());
    step->set_heldout_rmse_us(quality.heldout_rmse_us());
    step->set_lack_of_fit_p(quality.lack_of_fit_p());
  }

  // What the error becomes; bumps of the surface may be the last step.
  *report->mutable_final() = QualityOf(*study, search, explained.without_formula, ladder.residuals, false);
  const bool misfit = report->final().lack_of_fit_p() < kMisfitP;
  const bool had_surface =
      std::any_of(study->input.model->effects.begin(), study->input.model->effects.end(),
                  [](const EffectInstance& e) { return e.effect->name == "surface_error"; });
  ladder.surface =
      !had_surface && explained.fit.surface != 0 &&
      (explained.surface_nats > kSurfaceNats || (misfit && explained.surface_nats > kSurfaceWithMisfit));
  if (ladder.surface) {
    const auto effect = Catalogue().Find("surface_error");
    const v1::Quality quality = QualityOf(*study, search, explained.fit, ladder.residuals, true);
    v1::Step* step = report->add_steps();
    step->set_effect("surface_error");
    step->set_scope("object");
    TellEffect(*effect, step);
    step->set_probability(1 / (1 + std::exp(-explained.surface_nats)));
    step->set_gain_nats(explained.surface_nats);
    step->set_decided_by(DecidedBy({"surface_error"}));
    const auto add = [&](const char* name, double value_mm, double relative_error) {
      v1::ParameterValue* value = step->add_parameters();
      value->set_name(name);
      value->set_unit("mm");
      value->set_value(value_mm);
      value->set_std_error(value_mm * relative_error);
      value->set_lower(value_mm * std::max(0.0, 1 - 1.96 * relative_error));
      value->set_upper(value_mm * (1 + 1.96 * relative_error));
    };
    add("rms_mm", explained.surface_rms_m * 1e3, 1 / std::sqrt(2 * std::max(explained.surface_degrees, 1.0)));
    add("length_mm", explained.surface_length_m * 1e3, 0.4);
    step->set_rmse_us(quality.rmse_us());
    step->set_heldout_rmse_us(quality.heldout_rmse_us());
    step->set_lack_of_fit_p(quality.lack_of_fit_p());
    if (explained.formula < 0) *report->mutable_final() = quality;
    EffectInstance instance;
    instance.effect = effect;
    instance.per_object = true;
    instance.values = {RoundedTo(explained.surface_rms_m * 1e3, explained.surface_rms_m * 20) * 1e-3,
                       RoundedTo(explained.surface_length_m * 1e3, explained.surface_length_m * 20) * 1e-3};
    ladder.improved.effects.push_back(std::move(instance));
    ladder.changed = true;
  }
  AddNoise(explained.noise, &ladder, report);

  TOUCHSTONE_RETURN_IF_ERROR(DescribeCandidates(*study, explained, report));
  const double floor_us = report->noise_floor_us();
  const bool rest = explained.formula < 0 && report->final().lack_of_fit_p() < kUnexplainedP &&
                    report->final().rmse_us() > (1 + kUnexplainedShare) * floor_us;
  if (explained.formula >= 0 || rest)
    TOUCHSTONE_RETURN_IF_ERROR(DescribeUnexplained(*study, explained, floor_us, report));
  report->set_verdict(explained.formula >= 0 || rest ? v1::Report::UNEXPLAINED
                      : report->steps_size() > 0     ? v1::Report::MISSING_EFFECTS
                      : ladder.values_wrong          ? v1::Report::WRONG_VALUES
                                                     : v1::Report::ADEQUATE);
  if (ladder.changed) {
    if (!ladder.improved.name.empty()) ladder.improved.name += "_better";
    report->set_improved_model_yaml(FormatModel(ladder.improved));
    report->set_improved_model_hash(ladder.improved.Hash());
  }
  return ladder;
}

}  // namespace touchstone
