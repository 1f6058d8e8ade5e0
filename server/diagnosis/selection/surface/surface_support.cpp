#include "server/diagnosis/selection/surface/surface_support.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>

#include "server/base/numbers/decompositions.h"
#include "server/base/status.h"
#include "server/base/text/readable_time.h"
#include "server/base/units.h"
#include "server/diagnosis/selection/surface/pose_evidence.h"
#include "server/diagnosis/selection/surface/rules.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr double kMaxNats = 500;  // of differences that are exponents

// Curves over a covariate: one for all, one per finger, one per object.
std::vector<PoseFunction> CurvesOver(const std::string& name, const std::vector<double>& values,
                                     const std::vector<char>& used, int fingers, int objects) {
  double lower = INFINITY, upper = -INFINITY;
  for (size_t e = 0; e < values.size(); ++e)
    if (used[e / fingers] && std::isfinite(values[e]))
      lower = std::min(lower, values[e]), upper = std::max(upper, values[e]);
  std::vector<PoseFunction> curves;
  if (!(upper > lower)) return curves;
  const double range = upper - lower;
  for (const int kind : {0, 1, 2}) {
    const int copies = kind == 0 ? 1 : kind == 1 ? fingers : objects;
    if (kind > 0 && copies < 2) continue;
    PoseFunction curve;
    curve.name = name + (kind == 0 ? "" : kind == 1 ? ", finger by finger" : ", object by object");
    curve.size = range;
    curve.place = [values, kind, range](size_t e, int finger, int object) {
      const int copy = kind == 0 ? 0 : kind == 1 ? finger : object;
      return Eigen::Vector3d(values[e], kSurfaceRules.apart * range * copy, 0);
    };
    for (int copy = 0; copy < copies; ++copy)
      for (int knot = 0; knot < kSurfaceRules.knots_per_curve; ++knot)
        curve.knots.emplace_back(lower + range * knot / (kSurfaceRules.knots_per_curve - 1),
                                 kSurfaceRules.apart * range * copy, 0);
    curves.push_back(std::move(curve));
  }
  return curves;
}

void FindCurve(const Workspace& workspace, const touches::Prediction& p, const PoseEvidence& evidence,
               SurfaceSupport* support) {
  const touches::Observations& o = *workspace.searched;
  std::vector<double> incidence(p.cos_incidence.size());
  for (size_t e = 0; e < incidence.size(); ++e)
    incidence[e] = std::acos(std::clamp(p.cos_incidence[e], -1.0, 1.0));
  const std::pair<const char*, const std::vector<double>*> covariates[] = {{"incidence", &incidence},
                                                                           {"travel", &p.travel_m}};
  support->curve_nats = -INFINITY;
  for (const auto& [name, values] : covariates)
    for (const PoseFunction& curve :
         CurvesOver(name, *values, o.used, o.fingers, static_cast<int>(o.objects.size()))) {
      int best = 0;
      double sigma = 0;
      const double nats = evidence.NatsOf(evidence.LikelihoodOf(curve), &best, &sigma);
      if (nats <= support->curve_nats) continue;
      support->curve_nats = nats;
      support->curve = curve.name;
    }
}

// Whole poses left out: the effects fitted without them, the surface predicted there.
void PredictPoses(const PoseEvidence& evidence, const engine::Fit& fit, const engine::Likelihood& likelihood,
                  int hypothesis, SurfaceSupport* support) {
  std::vector<int> fold_of_row;
  for (const PoseMean& mean : evidence.means())
    fold_of_row.insert(fold_of_row.end(), mean.mean.rows(), mean.pose % kSurfaceRules.folds);
  std::vector<Eigen::MatrixXd> grams;
  const Eigen::MatrixXd left =
      evidence.values() -
      likelihood.FieldLeftOut(evidence.values(), hypothesis, fold_of_row, kSurfaceRules.folds, &grams);
  const int p = fit.model.size();
  std::vector<Eigen::VectorXd> steps;
  for (Eigen::MatrixXd& gram : grams) {
    // What the other poses leave open stays where it is.
    for (int i = 0; i < p; ++i)
      gram(1 + i, 1 + i) += std::pow(support->sigma_s / fit.model.parameters()[i].scale, 2);
    if (p > 0) steps.emplace_back(SymmetricSolver(gram.bottomRightCorner(p, p)).Solve(gram.col(0).tail(p)));
  }
  double scatter_s2 = 0, scatter_dof = 0;
  for (const PoseMean& mean : evidence.means()) {
    scatter_s2 += mean.scatter_s2;
    scatter_dof += static_cast<double>(mean.mean.rows()) * (mean.repeats - 1);
  }
  const double noise_s2 = scatter_dof > 0 ? scatter_s2 / scatter_dof : 0;
  double fall = 0, fall_squares = 0, excess = 0, before = scatter_s2, after = scatter_s2, rows = 0;
  int row = 0;
  for (const PoseMean& mean : evidence.means()) {
    const int size = static_cast<int>(mean.mean.rows());
    Eigen::VectorXd rest = left.col(0).segment(row, size);
    if (p > 0) rest -= left.block(row, 1, size, p) * steps[mean.pose % kSurfaceRules.folds];
    const double was = mean.mean.col(0).squaredNorm(), is = rest.squaredNorm();
    fall += was - is, fall_squares += (was - is) * (was - is);
    excess += was - size * noise_s2 / mean.weight;
    before += mean.weight * was;
    after += mean.weight * is;
    rows += static_cast<double>(size) * mean.repeats;
    row += size;
  }
  support->before_s = rows > 0 ? std::sqrt(before / rows) : 0;
  support->left_s = rows > 0 ? std::sqrt(after / rows) : 0;
  if (!(excess > 0)) return;
  support->share = fall / excess;
  support->share_error = std::sqrt(fall_squares) / excess;
}

}  // namespace

// Even odds for bumps and for errors of the poses; a surface that every finger sees its own way, or that follows how and
// not where it is met, is rarer. The evidence takes errors for Gaussian, which those of poses are not: a few large ones
// look smooth to it. So what poses left out say counts beside it, and without their word nothing is asserted.
double SurfaceSupport::Probability() const {
  const auto odds = [this](double nats) { return std::exp(std::min(nats - field_nats, kMaxNats)); };
  const double others =
      odds(0) + odds(own_nats) + kSurfaceRules.rare_odds * (odds(finger_field_nats) + odds(curve_nats));
  const double errors = share_error > 0 ? share / share_error : 0;
  const double nats =
      std::clamp(kSurfaceRules.per_share_error * (errors - kSurfaceRules.neutral_share_errors),
                 -kSurfaceRules.max_share.value(), kSurfaceRules.max_share.value());
  const double probability = 1 / (1 + others * std::exp(-nats));
  return errors < 1 ? std::min(probability, kSurfaceRules.unseen.value()) : probability;
}

bool SurfaceSupport::IsSurface() const {
  return Probability() > kSurfaceRules.likely && !(shortest && Probability() < kSurfaceRules.sure);
}

bool SurfaceSupport::IsElsewhere() const {
  return !IsSurface() && Probability() < kSurfaceRules.unlikely &&
         std::max({own_nats, finger_field_nats, curve_nats}) > kSurfaceRules.elsewhere;
}

std::string SurfaceSupport::SizeInWords() const {
  const double rms_mm = rms_m * kMillimetresPerMetre;
  return absl::StrFormat("The surfaces differ from their meshes by %.2g mm RMS, %s (0.05 to 0.3 mm).", rms_mm,
                         rms_mm > kSurfaceRules.usual_max   ? "more than printing and milling leave"
                         : rms_mm < kSurfaceRules.usual_min ? "less than most printing and milling leave"
                                                            : "as printing and milling leave");
}

std::string SurfaceSupport::Words(double rmse_s) const {
  return absl::StrFormat(
      "%s How they lie is not known to the model, so the error stays %s; at poses left out, the surface that "
      "the other poses show would leave %s (`--save-model FILE --with-surface-map` keeps it).",
      SizeInWords(), TimeInWords(rmse_s), TimeInWords(std::min(left_s, rmse_s)));
}

std::string SurfaceSupport::WordsOfMap(double heldout_s) const {
  return absl::StrFormat(
      "%s The model holds a map of them, found on these touches: at poses that it has not seen it leaves %s.",
      SizeInWords(), TimeInWords(heldout_s));
}

std::string SurfaceSupport::WordsOfRest() const {
  std::string words = "What is left repeats with the pose, but not with the place on the surface";
  const double most = std::max({field_nats, own_nats, finger_field_nats, curve_nats});
  if (curve_nats == most)
    absl::StrAppend(&words, ": it follows the ", curve);
  else if (finger_field_nats == most)
    absl::StrAppend(&words, ": fingers disagree at the same place");
  else if (own_nats == most)
    absl::StrAppend(&words, ": each pose has an error of its own, larger on steep faces");
  else if (shortest)
    absl::StrAppend(&words, ": it changes within the shortest distance that the touches can show");
  return words + ".";
}

PoseFunction SurfaceOf(const Workspace& workspace, const touches::Prediction& details) {
  PoseFunction field;
  field.by_object = true;
  field.along_normal = true;
  for (const auto& surface : workspace.searched->surfaces)
    field.size += (surface->bounds().max_m - surface->bounds().min_m).maxCoeff() /
                  static_cast<double>(workspace.searched->surfaces.size());
  field.place = [&details](size_t e, int, int) { return details.contact_in_mesh_m[e]; };
  return field;
}

absl::StatusOr<SurfaceSupport> FindSurfaceSupport(const Workspace& workspace, const engine::Fit& fit) {
  SurfaceSupport support;
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction details,
                              workspace.searched_predictor->Run(fit.model.base(), true, false));
  const PoseEvidence evidence(workspace, fit, details);
  if (evidence.means().empty()) return support;
  const PoseFunction field = SurfaceOf(workspace, details);
  PoseFunction per_finger = field;
  per_finger.place = [&details, size = field.size](size_t e, int finger, int) -> Eigen::Vector3d {
    return details.contact_in_mesh_m[e] + Eigen::Vector3d(kSurfaceRules.apart * size * finger, 0, 0);
  };
  int best = 0, best_finger = 0;
  double sigma_finger_s = 0;
  const engine::Likelihood likelihood = evidence.LikelihoodOf(field);
  support.field_nats = evidence.NatsOf(likelihood, &best, &support.sigma_s);
  support.finger_field_nats =
      evidence.NatsOf(evidence.LikelihoodOf(per_finger), &best_finger, &sigma_finger_s);
  support.own_nats = std::max(evidence.NatsOfOwnErrors(PoseEvidence::OwnError::kAlongNormal),
                              evidence.NatsOfOwnErrors(PoseEvidence::OwnError::kAlongSurface));
  FindCurve(workspace, details, evidence, &support);
  const engine::SurfaceErrorHypothesis& hypothesis = likelihood.hypotheses()[best];
  support.rms_m = hypothesis.amplitude_over_sigma * support.sigma_s;
  support.length_m = hypothesis.length_m;
  support.shortest = hypothesis.length_index == 0;
  PredictPoses(evidence, fit, likelihood, best, &support);
  return support;
}

}  // namespace touchstone::diagnosis::selection
