#include "server/diagnosis/joint/conflicts.h"

#include <algorithm>
#include <utility>

#include "server/base/status.h"
#include "server/diagnosis/joint/rules.h"

namespace touchstone::diagnosis::joint {
namespace {

bool HasName(const std::vector<SharedEffect>& effects, const std::string& name) {
  return std::any_of(effects.begin(), effects.end(),
                     [&](const SharedEffect& effect) { return effect.name() == name; });
}

// Values of one effect as one kind alone has them beside its own explanation.
struct AloneValues {
  engine::Fit fit;
  Eigen::MatrixXd covariance;
  int index = -1;
};

absl::StatusOr<AloneValues> FitAlone(const Side& side, const SharedEffect& effect) {
  const engine::Modality& modality = *side.modality;
  std::vector<SharedEffect> shared = side.SharedOf(modality.alone());
  if (!HasName(shared, effect.name())) shared.push_back(effect);
  AloneValues values;
  TOUCHSTONE_ASSIGN_OR_RETURN(values.fit,
                              engine::FitModel(modality.experiment(), side.Free(shared, side.own_alone())));
  TOUCHSTONE_ASSIGN_OR_RETURN(const engine::FinalRows rows, modality.RowsNear(values.fit));
  if (rows.owner != nullptr) {
    TOUCHSTONE_ASSIGN_OR_RETURN(values.fit, engine::FitModel(rows.experiment, values.fit.model));
  }
  values.covariance = modality.CovarianceOf(rows.experiment, values.fit);
  values.index = IndexOf(values.fit.model.base(), effect.name());
  return values;
}

// Where chance would hardly part the values of two kinds so far.
void AddConflict(const std::string& name, const std::pair<int, AloneValues>& a,
                 const std::pair<int, AloneValues>& b, double ahead, std::vector<Conflict>* conflicts) {
  const AloneValues &one = a.second, &other = b.second;
  std::vector<std::pair<int, int>> same;
  for (int i = 0; i < one.fit.model.size(); ++i)
    for (int j = 0; j < other.fit.model.size(); ++j)
      if (one.fit.model.parameters()[i].effect == one.index &&
          IsSameValue(one.fit.model, i, other.fit.model, j))
        same.emplace_back(i, j);
  const int n = static_cast<int>(same.size());
  Eigen::VectorXd difference(n);
  Eigen::MatrixXd covariance(n, n);
  for (int r = 0; r < n; ++r) {
    difference[r] = one.fit.point[same[r].first] - other.fit.point[same[r].second];
    for (int c = 0; c < n; ++c)
      covariance(r, c) =
          one.covariance(same[r].first, same[c].first) + other.covariance(same[r].second, same[c].second);
  }
  const double p = engine::WaldP(difference, covariance);
  if (p > kJointRules.conflict_p) return;
  conflicts->push_back({name,
                        {a.first, b.first},
                        {one.fit.model.Describe(one.index, one.fit.point, one.covariance),
                         other.fit.model.Describe(other.index, other.fit.point, other.covariance)},
                        p,
                        ahead});
}

}  // namespace

absl::StatusOr<std::vector<Conflict>> FindConflicts(const Sides& sides, const SharedSelection& selection) {
  std::vector<Conflict> conflicts;
  std::vector<Part> parts;
  std::vector<SharedEffect> in_doubt;
  for (const Side& side : sides) {
    parts.push_back({&side.modality->experiment(), side.modality->alone().model, 1});
    for (const SharedEffect& effect : side.SharedOf(side.modality->alone()))
      if (!HasName(in_doubt, effect.name())) in_doubt.push_back(effect);
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const JointFit apart,
                              FitJointly(parts, [](const engine::Parameterization&, int) { return true; }));
  const double ahead = apart.log_evidence - selection.best.fit.log_evidence;
  if (ahead < kJointRules.conflict_nats) return conflicts;
  for (const SharedEffect& effect : in_doubt) {
    std::vector<std::pair<int, AloneValues>> alone;
    for (const Side& side : sides) {
      if (!side.modality->Sees(*effect.instance.effect)) continue;
      TOUCHSTONE_ASSIGN_OR_RETURN(AloneValues values, FitAlone(side, effect));
      alone.emplace_back(side.kind, std::move(values));
    }
    for (size_t i = 0; i < alone.size(); ++i)
      for (size_t j = i + 1; j < alone.size(); ++j)
        AddConflict(effect.name(), alone[i], alone[j], ahead, &conflicts);
  }
  return conflicts;
}

}  // namespace touchstone::diagnosis::joint
