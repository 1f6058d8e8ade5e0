#include "server/diagnosis/answers/uncertainty_reports.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <array>
#include <map>

#include "server/base/status.h"
#include "server/base/text/file_number.h"
#include "server/base/units.h"
#include "server/diagnosis/answers/how_wrong.h"
#include "server/diagnosis/answers/rules.h"
#include "server/diagnosis/design/plan_check.h"
#include "server/diagnosis/selection/touch_modality.h"
#include "server/diagnosis/selection/workspace.h"
#include "server/diagnosis/touches/time_uncertainties.h"
#include "server/model/value_names.h"

namespace touchstone::diagnosis {
namespace {

using uncertainty::Budget;

void PaintPoints(const touches::Observations& o, const touches::Prediction& prediction,
                 const touches::SetUncertainty& found, std::vector<residuals::SurfaceResidual>* points) {
  std::map<std::array<double, 3>, size_t> entry_at;
  const auto key = [](const Eigen::Vector3d& place) {
    return std::array<double, 3>{place.x(), place.y(), place.z()};
  };
  for (size_t e = 0; e < found.combined_s.size(); ++e)
    if (!std::isnan(found.combined_s[e])) entry_at[key(prediction.contact_m[e])] = e;
  for (residuals::SurfaceResidual& point : *points) {
    const auto at = entry_at.find(key(point.contact_m));
    if (at == entry_at.end() || static_cast<int>(at->second % static_cast<size_t>(o.fingers)) != point.finger)
      continue;
    point.std_uncertainty_s = found.combined_s[at->second];
    point.beyond_measured = found.beyond_measured[at->second] != 0;
  }
}

std::string PercentOf(double share) {
  return absl::StrFormat("%.0f %%", 100 * share);
}

// What limits the numbers.
void AddWarnings(const std::vector<Budget>& budgets, const uncertainty::Posterior& posterior,
                 std::vector<std::string>* warnings) {
  for (const Budget& budget : budgets) {
    if (budget.object.empty()) continue;
    const auto measured = posterior.measured.find(budget.object);
    if (measured == posterior.measured.end() || measured->second.contact_m.empty())
      warnings->push_back(absl::StrCat(budget.object,
                                       " was not measured: what its surface and its place leave open is not "
                                       "known, and its uncertainties are too small."));
    else if (budget.beyond_measured > 0)
      warnings->push_back(
          absl::StrCat(budget.object, ": of ", budget.touches, " touches ", budget.beyond_measured,
                       " meet it where nothing was measured near (within a tenth of the object's diagonal "
                       "and 30 deg of the normal); values are extrapolated there."));
  }
}

std::string Summary(const Budget& all) {
  if (all.touches == 0)
    return "No touch of this plan meets its object with two fingers or more: nothing is predicted.";
  const uncertainty::Contribution& first = all.contributions[0];
  return absl::StrFormat(
      "A contact time of these %d touches, less the mean over its touch, is predicted with a standard "
      "uncertainty of %.3g ms; %s of its square is %s.",
      all.touches, all.combined / 1000, PercentOf(first.share), first.name);
}

}  // namespace

void AddMisfitOfTouches(const report::DataReport& data, std::vector<Budget>* budgets) {
  if (!data.final || !data.noise_floor || data.fingers.size() < 2) return;
  uncertainty::AddMisfit({data.final->rmse, data.noise_floor->sigma, data.final->lack_of_fit_p},
                         1 - 1 / static_cast<double>(data.fingers.size()), budgets);
}

void WarnOfBounds(const uncertainty::Posterior& posterior, std::vector<std::string>* warnings) {
  for (size_t i = 0; i < posterior.values.size(); ++i) {
    const double value = posterior.ValueOf(posterior.model, i);
    const double lower = posterior.Lower(i), upper = posterior.Upper(i);
    const double near = kAnswerRules.at_bound * (upper - lower);
    if (posterior.StdError(i) > near || (value - lower > near && upper - value > near)) continue;
    const model::ParameterInfo& parameter = posterior.ParameterOf(i);
    const uncertainty::OpenValue& open = posterior.values[i];
    const std::string entry = model::EntryName(parameter, open.entry, posterior.model.fingers);
    warnings->push_back(absl::StrCat(
        model::NameOf(posterior.EffectOf(i)), ".", parameter.name, entry.empty() ? "" : " of ", entry,
        open.object.empty() ? "" : " on ", open.object, " = ", FileNumber(parameter.unit, value),
        " is at a bound of its range, where it has no standard error: what it leaves open is not in the "
        "uncertainty budget."));
  }
}

absl::Status AddUncertainty(const touches::Predictor& predictor, const touches::Prediction& prediction,
                            const uncertainty::Posterior& posterior, report::Diagnosis* diagnosis) {
  const uncertainty::PredictedTimes times(std::make_shared<const uncertainty::Posterior>(posterior));
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::SetUncertainty found,
                              touches::UncertaintyOf(predictor, prediction, times));
  for (const Budget& budget : found.budgets)
    diagnosis->uncertainty.push_back(uncertainty::Scaled(budget, 1 / SiFactor(Unit::kMicrosecond)));
  AddMisfitOfTouches(diagnosis->data[0], &diagnosis->uncertainty);
  WarnOfBounds(posterior, &diagnosis->warnings);
  PaintPoints(predictor.observations(), prediction, found, &diagnosis->data[0].surface_points);
  return absl::OkStatus();
}

absl::StatusOr<report::Diagnosis> UncertaintyOfPlan(const DiagnosisInput& input,
                                                    const uncertainty::Posterior& posterior,
                                                    const DiagnosisContext& context) {
  if (input.set == nullptr || !input.set->has_poses)
    return absl::InvalidArgumentError(
        "a plan or a set of touches with poses was expected: what is predicted is the time of a commanded "
        "touch");
  DiagnosisInput touches = design::AsPlan(input);
  touches.model = std::make_shared<const model::Model>(selection::TouchPartOf(posterior.model));
  TOUCHSTONE_ASSIGN_OR_RETURN(touches::Observations observations, touches::MakeObservations(touches));
  const touches::Predictor predictor(observations, context.pool);
  if (context.progress && !context.progress("predicting", 0.2)) return absl::CancelledError("cancelled");
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction prediction,
                              predictor.Run(posterior.model, true, false));
  // Where a small move makes a finger meet another part of the object, no standard deviation says how far the
  // time may jump.
  selection::LeaveOutMissed(prediction, &observations);
  TOUCHSTONE_ASSIGN_OR_RETURN(const int edges,
                              selection::LeaveOutEdges(predictor, posterior.model, &observations));
  report::Diagnosis diagnosis;
  diagnosis.model_name = posterior.model.name;
  diagnosis.model_hash = posterior.model.Hash();
  diagnosis.data = {DataOf(observations, touches)};
  const std::vector<double> none(observations.time_s.size(), 0);
  diagnosis.data[0].surface_points = residuals::MakeSurfaceResiduals(observations, prediction, none, none);
  diagnosis.data[0].outlines = residuals::MakeOutlines(observations);
  TOUCHSTONE_RETURN_IF_ERROR(AddUncertainty(predictor, prediction, posterior, &diagnosis));
  AddWarnings(diagnosis.uncertainty, posterior, &diagnosis.warnings);
  if (edges > 0)
    diagnosis.warnings.push_back(absl::StrCat(edges, edges == 1 ? " touch meets" : " touches meet",
                                              " an edge, where a small move makes a finger meet another part "
                                              "of the object: the budget leaves them out."));
  diagnosis.summary = Summary(diagnosis.uncertainty.back());
  return diagnosis;
}

}  // namespace touchstone::diagnosis
