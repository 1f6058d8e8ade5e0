#include "server/diagnosis/selection/surface_support.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "server/base/readable_time.h"
#include "server/base/status.h"
#include "server/base/units.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr int kSurfaceFolds = 8;       // of poses
constexpr int kKnotsPerCurve = 24;     // places that stand for a curve's range
constexpr double kMinFieldNats = 1;    // of bumps over errors per pose
constexpr double kMinShareErrors = 0;  // standard errors of the share of the excess that is predicted
constexpr double kUsualMinMm = 0.05, kUsualMaxMm = 0.3;  // RMS that printing and milling leave
constexpr double kMaxMm = 1;                             // ... beyond which it is another object
constexpr double kApart = 100;                           // ranges between curves that share nothing
constexpr double kMinSurfaceCosine = 0.1;                // as in the effect

// One pose with one set of reporting fingers: the mean of its repeats.
struct PoseMean {
  int touch = 0;  // of the contrasts: the first of the repeats
  int object = 0, pose = 0;
  Eigen::VectorXd mean;   // contrasts, s
  double weight = 0;      // sum of the repeats' weights
  double scatter_s2 = 0;  // sum of squares about the mean
  int repeats = 0;
};

std::vector<PoseMean> MeansOf(const Workspace& workspace, const Eigen::VectorXd& rows) {
  const touches::Contrasts& contrasts = *workspace.contrasts;
  const touches::Observations& o = *workspace.searched;
  std::map<std::pair<int, uint32_t>, PoseMean> by_pose;
  for (int t = 0; t < static_cast<int>(contrasts.touches().size()); ++t) {
    const int k = contrasts.touches()[t];
    uint32_t fingers = 0;
    for (int i = 0; i < o.fingers; ++i) fingers |= contrasts.TakesPart(t, i) ? 1u << i : 0;
    PoseMean& mean = by_pose[{o.pose[k], fingers}];
    const int count = static_cast<int>(contrasts.MatrixOf(t).rows());
    if (mean.repeats == 0) mean.touch = t, mean.object = o.object[k], mean.pose = o.pose[k];
    if (mean.repeats == 0) mean.mean = Eigen::VectorXd::Zero(count);
    const double root = contrasts.root_weights()[t];
    const Eigen::VectorXd scaled = rows.segment(contrasts.FirstRow(t), count);
    mean.mean += root * scaled;
    mean.weight += root * root;
    mean.scatter_s2 += scaled.squaredNorm();
    ++mean.repeats;
  }
  std::vector<PoseMean> means;
  for (auto& [key, mean] : by_pose) {
    if (!(mean.weight > 0)) continue;
    mean.mean /= mean.weight;
    mean.scatter_s2 = std::max(mean.scatter_s2 - mean.weight * mean.mean.squaredNorm(), 0.0);
    means.push_back(std::move(mean));
  }
  std::stable_sort(means.begin(), means.end(),
                   [](const PoseMean& a, const PoseMean& b) { return a.object < b.object; });
  return means;
}

// A smooth function of something that readings have: their place, or a covariate.
struct PoseFunction {
  std::string name;
  bool by_object = false;  // groups: objects, else all in one
  // The coordinate of reading e = k * fingers + i of an object, and the change of its time per unit.
  std::function<Eigen::Vector3d(size_t e, int finger, int object)> place;
  bool along_normal = false;
  double size = 0;
  std::vector<Eigen::Vector3d> knots;  // empty: the places themselves
};

class PoseEvidence {
 public:
  PoseEvidence(const Workspace& workspace, std::vector<PoseMean> means)
      : workspace_(workspace), means_(std::move(means)) {
    for (const PoseMean& mean : means_) rows_ += static_cast<int>(mean.mean.size());
    values_.resize(rows_);
    int row = 0;
    for (const PoseMean& mean : means_) {
      values_.segment(row, mean.mean.size()) = mean.mean;
      row += static_cast<int>(mean.mean.size());
    }
  }

  const std::vector<PoseMean>& means() const { return means_; }
  const Eigen::VectorXd& values() const { return values_; }

  inference::Likelihood LikelihoodOf(const PoseFunction& explanation) const {
    const inference::SmoothErrorGeometry geometry = GeometryOf(explanation);
    return inference::Likelihood(FirstRows(explanation.by_object), &geometry, 0, workspace_.context.pool);
  }

  // Log evidence of any over none; `best`: the most probable hypothesis that there is one.
  double NatsOf(const inference::Likelihood& likelihood, int* best, double* sigma) const {
    const inference::Likelihood::Columns columns = likelihood.Prepare(values_);
    const int hypotheses = static_cast<int>(likelihood.hypotheses().size());
    std::vector<double> logs;
    *best = 0;
    for (int s = 0; s < hypotheses; ++s) {
      const double q = likelihood.Gram(columns, s)(0, 0);
      logs.push_back(likelihood.LogLikelihood(q, s));
      if (s > 0 && (*best == 0 || logs[s] > logs[*best])) *best = s, *sigma = likelihood.Sigma(q, 0);
    }
    if (hypotheses < 2) return 0;
    double sum = 0;
    for (int s = 1; s < hypotheses; ++s) sum += std::exp(logs[s] - logs[*best]) / (hypotheses - 1);
    return logs[*best] + std::log(sum) - logs[0];
  }

 private:
  std::vector<int> FirstRows(bool by_object) const {
    if (!by_object) return {0, rows_};
    std::vector<int> first(workspace_.searched->objects.size() + 1, 0);
    for (const PoseMean& mean : means_) first[mean.object + 1] += static_cast<int>(mean.mean.size());
    for (size_t object = 1; object < first.size(); ++object) first[object] += first[object - 1];
    return first;
  }

  inference::SmoothErrorGeometry GeometryOf(const PoseFunction& explanation) const {
    const touches::Observations& o = *workspace_.searched;
    const touches::Prediction& p = workspace_.searched_nominal;
    const size_t groups = explanation.by_object ? o.objects.size() : 1;
    inference::SmoothErrorGeometry geometry;
    geometry.sites.resize(groups);
    geometry.distinct_m.resize(groups);
    geometry.size_m = explanation.size;
    int row = 0, counted = 0;
    for (const PoseMean& mean : means_) {
      const int k = workspace_.contrasts->touches()[mean.touch];
      const Eigen::MatrixXd& h = workspace_.contrasts->MatrixOf(mean.touch);
      const size_t group = explanation.by_object ? mean.object : 0;
      for (int i = 0; i < o.fingers; ++i) {
        if (!workspace_.contrasts->TakesPart(mean.touch, i)) continue;
        const size_t e = static_cast<size_t>(k) * o.fingers + i;
        inference::SmoothErrorSite site;
        site.position_m = explanation.place(e, i, mean.object);
        site.first_row = row;
        const double cosine =
            explanation.along_normal ? std::max(p.cos_incidence[e], kMinSurfaceCosine) : 1.0;
        for (int j = 0; j < h.rows(); ++j)
          site.row_per_m.push_back(-p.inverse_speed_s_per_m[e] / cosine * h(j, i));
        geometry.mean_row_per_m += p.inverse_speed_s_per_m[e];
        ++counted;
        if (explanation.knots.empty()) geometry.distinct_m[group].push_back(site.position_m);
        geometry.sites[group].push_back(std::move(site));
      }
      row += static_cast<int>(mean.mean.size());
    }
    if (!explanation.knots.empty()) geometry.distinct_m[0] = explanation.knots;
    if (counted > 0) geometry.mean_row_per_m /= counted;
    return geometry;
  }

  const Workspace& workspace_;
  std::vector<PoseMean> means_;
  int rows_ = 0;
  Eigen::VectorXd values_;
};

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
      return Eigen::Vector3d(values[e], kApart * range * copy, 0);
    };
    for (int copy = 0; copy < copies; ++copy)
      for (int knot = 0; knot < kKnotsPerCurve; ++knot)
        curve.knots.emplace_back(lower + range * knot / (kKnotsPerCurve - 1), kApart * range * copy, 0);
    curves.push_back(std::move(curve));
  }
  return curves;
}

void FindCurve(const Workspace& workspace, const PoseEvidence& evidence, SurfaceSupport* support) {
  const touches::Observations& o = *workspace.searched;
  const touches::Prediction& p = workspace.searched_nominal;
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

// Whole poses left out, the surface predicted there.
void PredictPoses(const PoseEvidence& evidence, const inference::Likelihood& likelihood, int hypothesis,
                  SurfaceSupport* support) {
  std::vector<int> fold_of_row;
  for (const PoseMean& mean : evidence.means())
    fold_of_row.insert(fold_of_row.end(), mean.mean.size(), mean.pose % kSurfaceFolds);
  const Eigen::VectorXd expected =
      likelihood.FieldLeftOut(evidence.values(), hypothesis, fold_of_row, kSurfaceFolds);
  double scatter_s2 = 0, scatter_dof = 0;
  for (const PoseMean& mean : evidence.means()) {
    scatter_s2 += mean.scatter_s2;
    scatter_dof += static_cast<double>(mean.mean.size()) * (mean.repeats - 1);
  }
  const double noise_s2 = scatter_dof > 0 ? scatter_s2 / scatter_dof : 0;
  double fall = 0, fall_squares = 0, excess = 0, total = scatter_s2, rows = 0;
  int row = 0;
  for (const PoseMean& mean : evidence.means()) {
    const int size = static_cast<int>(mean.mean.size());
    const double left = (mean.mean - expected.segment(row, size)).squaredNorm();
    const double by = mean.mean.squaredNorm() - left;
    fall += by, fall_squares += by * by;
    excess += mean.mean.squaredNorm() - size * noise_s2 / mean.weight;
    total += mean.weight * left;
    rows += static_cast<double>(size) * mean.repeats;
    row += size;
  }
  support->left_s = rows > 0 ? std::sqrt(total / rows) : 0;
  if (!(excess > 0)) return;
  support->share = fall / excess;
  support->share_error = std::sqrt(fall_squares) / excess;
}

}  // namespace

bool SurfaceSupport::IsSurface() const {
  return rms_m * kMillimetresPerMetre <= kMaxMm && field_nats > kMinFieldNats && !shortest &&
         curve_nats < field_nats && finger_field_nats < field_nats && share > kMinShareErrors * share_error;
}

std::string SurfaceSupport::Words(double rmse_s) const {
  const double rms_mm = rms_m * kMillimetresPerMetre;
  const char* as_usual = rms_mm > kUsualMaxMm ? ", more than printing and milling leave (0.05 to 0.3 mm)"
                         : rms_mm < kUsualMinMm
                             ? ", less than most printing and milling leave (0.05 to 0.3 mm)"
                             : ", as printing and milling leave (0.05 to 0.3 mm)";
  return absl::StrFormat(
      "The surfaces differ from their meshes by %.2g mm RMS%s. How they lie is not known, so the error stays "
      "%s; at poses left out, the surface that the other poses show would leave %s. Measure the surfaces to "
      "know them.",
      rms_mm, as_usual, TimeInWords(rmse_s), TimeInWords(std::min(left_s, rmse_s)));
}

std::string SurfaceSupport::WordsOfRest() const {
  std::string words = "What is left repeats with the pose, but not with the place on the surface";
  if (curve_nats > std::max(field_nats, kMinFieldNats) && curve_nats > finger_field_nats)
    absl::StrAppend(&words, ": it follows the ", curve);
  else if (finger_field_nats > std::max(field_nats, kMinFieldNats))
    absl::StrAppend(&words, ": fingers disagree at the same place");
  else if (shortest && field_nats > kMinFieldNats)
    absl::StrAppend(&words, ": it changes within the shortest distance that the touches can show");
  return words + ".";
}

absl::StatusOr<SurfaceSupport> FindSurfaceSupport(const Workspace& workspace, const inference::Fit& fit) {
  SurfaceSupport support;
  const PoseEvidence evidence(workspace, MeansOf(workspace, fit.columns.values.col(0)));
  if (evidence.means().empty()) return support;
  const touches::Observations& o = *workspace.searched;
  const touches::Prediction& p = workspace.searched_nominal;
  PoseFunction field;
  field.by_object = true;
  field.along_normal = true;
  for (const auto& surface : o.surfaces)
    field.size += (surface->bounds().max_m - surface->bounds().min_m).maxCoeff() /
                  static_cast<double>(o.surfaces.size());
  field.place = [&p](size_t e, int, int) { return p.contact_m[e]; };
  PoseFunction per_finger = field;
  per_finger.place = [&p, size = field.size](size_t e, int finger, int) -> Eigen::Vector3d {
    return p.contact_m[e] + Eigen::Vector3d(kApart * size * finger, 0, 0);
  };
  int best = 0, best_finger = 0;
  double sigma = 0, sigma_finger = 0;
  const inference::Likelihood likelihood = evidence.LikelihoodOf(field);
  support.field_nats = evidence.NatsOf(likelihood, &best, &sigma);
  support.finger_field_nats = evidence.NatsOf(evidence.LikelihoodOf(per_finger), &best_finger, &sigma_finger);
  FindCurve(workspace, evidence, &support);
  const inference::SurfaceErrorHypothesis& hypothesis = likelihood.hypotheses()[best];
  support.rms_m = hypothesis.amplitude_over_sigma * sigma;
  support.length_m = hypothesis.length_m;
  support.shortest = hypothesis.length_index == 0;
  PredictPoses(evidence, likelihood, best, &support);
  return support;
}

}  // namespace touchstone::diagnosis::selection
