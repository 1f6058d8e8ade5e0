// What goes of an explanation that a search of photographs has found, because its values say nothing.
#include <cmath>
#include <vector>

#include "server/base/status.h"
#include "server/diagnosis/images/pixels/image_field.h"
#include "server/diagnosis/images/search/photo_search.h"

namespace touchstone::diagnosis::images {
namespace {

constexpr double kStepP = 1e-4;      // of a step's values, with the scatter between pictures
constexpr double kFaint = 0.1;       // of the noise
constexpr double kNearChoice = 0.1;  // of a choice, that a fitted mean of two is it

// Whether the values of effect `index` differ from what changes nothing, under this covariance.
bool IsSeen(const engine::Fit& fit, int index, const Eigen::MatrixXd& covariance) {
  std::vector<int> own;
  for (int i = 0; i < fit.model.size(); ++i)
    if (fit.model.parameters()[i].effect == index) own.push_back(i);
  const int n = static_cast<int>(own.size());
  Eigen::VectorXd value(n);
  Eigen::MatrixXd part(n, n);
  for (int a = 0; a < n; ++a) {
    value[a] = fit.point[own[a]] - fit.model.parameters()[own[a]].neutral;
    for (int b = 0; b < n; ++b) part(a, b) = covariance(own[a], own[b]);
  }
  return engine::WaldP(value, part) < kStepP;
}

}  // namespace

absl::Status DropFaintField(PhotoSelection* selection) {
  const int index = IndexOfImageField(selection->fit.model.base());
  if (index < 0) return absl::OkStatus();
  const int side = 64;  // of a coarse picture
  const std::vector<double>& values = selection->fit.model.base().effects[index].values;
  const Eigen::VectorXf field =
      ImageFieldFunctions(side, side) *
      Eigen::Map<const Eigen::VectorXd>(values.data(), kImageFieldSize).cast<float>();
  if (field.norm() / side > kFaint * selection->photographs->noise.sigma_grey) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(
      selection->fit, engine::FitModel(*selection->fine.experiment, selection->fit.model.Without(index)));
  return absl::OkStatus();
}

absl::Status DropUnsteady(PhotoSelection* selection) {
  for (bool dropped = true; dropped;) {
    dropped = false;
    selection->covariance = CovarianceBetweenBlocks(*selection->fine.experiment, selection->fit);
    for (int index = static_cast<int>(selection->fit.model.base().effects.size()) - 1;
         index >= selection->initial_effects && !dropped; --index) {
      if (IsSeen(selection->fit, index, selection->covariance)) continue;
      TOUCHSTONE_ASSIGN_OR_RETURN(
          selection->fit, engine::FitModel(*selection->fine.experiment, selection->fit.model.Without(index)));
      dropped = true;
    }
  }
  return absl::OkStatus();
}

absl::Status HoldChoices(PhotoSelection* selection) {
  for (int e = static_cast<int>(selection->fit.model.base().effects.size()) - 1; e >= 0; --e) {
    const model::EffectInstance& instance = selection->fit.model.base().effects[e];
    if (!selection->fit.model.IsFree(e) || instance.effect->parameters.empty() ||
        instance.effect->parameters[0].choices.empty())
      continue;
    engine::Parameterization held = selection->fit.model;
    Eigen::VectorXd point = held.Start();
    bool is_choice = true;
    for (int i = 0; i < held.size(); ++i) {
      if (held.parameters()[i].effect != e) continue;
      const double choice = std::round(point[i]);
      is_choice &= std::abs(point[i] - choice) < kNearChoice && choice != held.parameters()[i].neutral;
      point[i] = choice;
    }
    held.MoveTo(point);
    if (is_choice || e < selection->initial_effects)
      held.Hold(e);
    else
      held = held.Without(e);
    TOUCHSTONE_ASSIGN_OR_RETURN(selection->fit, engine::FitModel(*selection->fine.experiment, held));
  }
  return absl::OkStatus();
}

}  // namespace touchstone::diagnosis::images
