#include "server/diagnosis/joint/shared_effects.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <mutex>

#include "server/base/decompositions.h"
#include "server/base/distributions.h"
#include "server/base/status.h"
#include "server/diagnosis/images/photo_quality.h"
#include "server/diagnosis/images/photo_search.h"
#include "server/diagnosis/inference/held_out.h"
#include "server/diagnosis/joint/shared_search.h"
#include "server/diagnosis/selection/ladder.h"
#include "server/diagnosis/selection/selection.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::joint {
namespace {

constexpr double kConflictNats = 9;  // that values of their own need over one value
constexpr double kConflictP = 1e-4;  // ... and of values so far apart by chance
constexpr double kShownP = 1e-3;     // of a value that one kind alone has by chance
constexpr double kUnknown = 10;      // usual sizes: a value that is known no better is not known

// P of a value as far from `neutral` as this; 1 where nothing is known.
double WaldP(const Eigen::VectorXd& difference, const Eigen::MatrixXd& covariance) {
  std::vector<int> known;
  for (int i = 0; i < difference.size(); ++i)
    if (covariance(i, i) > 0) known.push_back(i);
  const int n = static_cast<int>(known.size());
  if (n == 0) return 1;
  // Scaled first: lengths and angles differ by orders of magnitude.
  Eigen::VectorXd scaled(n);
  Eigen::MatrixXd correlation(n, n);
  for (int a = 0; a < n; ++a) {
    scaled[a] = difference[known[a]] / std::sqrt(covariance(known[a], known[a]));
    for (int b = 0; b < n; ++b)
      correlation(a, b) = covariance(known[a], known[b]) /
                          std::sqrt(covariance(known[a], known[a]) * covariance(known[b], known[b]));
  }
  const double wald = scaled.dot(SymmetricSolver(correlation).Solve(scaled));
  return ChiSquaredTail(wald, n);
}

// Everything that both searches work on. The parts point to one another.
struct Prepared {
  std::unique_ptr<selection::Workspace> workspace;
  selection::SelectionResult touches;
  images::Photographs photographs;
  images::PhotoSelection pictures;
  Sides sides;
};

class SharedFinder {
 public:
  SharedFinder(const DiagnosisInput& touches, const DiagnosisInput& photographs,
               const DiagnosisContext& context)
      : touches_(touches), photographs_(photographs), context_(context) {
    // Fits ask from whatever thread works; the caller is told by one at a time.
    if (context.progress)
      context_.progress = [this, &context](const std::string& stage, double done) {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (!cancelled_ && !context.progress(stage, done)) cancelled_ = true;
        return !cancelled_;
      };
  }

  absl::StatusOr<SharedEffects> Run() {
    for (const auto& effect : effects::TouchEffects())
      if (IsShared(*effect)) found_.settled.push_back(effect->name);
    found_.in_place = *photographs_.model;
    TOUCHSTONE_RETURN_IF_ERROR(PrepareTouches());
    TOUCHSTONE_RETURN_IF_ERROR(PreparePhotographs());
    TOUCHSTONE_RETURN_IF_ERROR(Enter("fitting both together", 0.4));
    TOUCHSTONE_ASSIGN_OR_RETURN(const SharedSelection selection, SearchShared(p_.sides));
    TOUCHSTONE_RETURN_IF_ERROR(Enter("fitting both together", 0.55));
    TOUCHSTONE_RETURN_IF_ERROR(FindConflicts(selection));
    FindUndecided(selection);
    if (found_.conflicts.empty() && !selection.best.shared.empty())
      TOUCHSTONE_RETURN_IF_ERROR(Describe(selection));
    return std::move(found_);
  }

 private:
  absl::Status Enter(const char* stage, double done) const {
    return !context_.progress || context_.progress(stage, done)
               ? absl::OkStatus()
               : absl::CancelledError("the diagnosis was cancelled");
  }

  absl::Status PrepareTouches() {
    TOUCHSTONE_RETURN_IF_ERROR(Enter("fitting the touches", 0.05));
    TOUCHSTONE_ASSIGN_OR_RETURN(p_.workspace, selection::MakeWorkspace(touches_, context_));
    p_.workspace->experiment.cancelled = [this] {
      return context_.progress && !context_.progress("fitting the touches", 0);
    };
    TOUCHSTONE_ASSIGN_OR_RETURN(p_.touches, selection::SelectExplanation(p_.workspace.get()));
    Side& side = p_.sides[kTouches];
    side.kind = kTouches;
    side.given = touches_.model;
    side.objects = p_.workspace->searched->objects;
    side.alone = p_.touches.fit;
    side.Prepare(p_.workspace->experiment, p_.touches.search->candidates());
    return absl::OkStatus();
  }

  absl::Status PreparePhotographs() {
    TOUCHSTONE_RETURN_IF_ERROR(Enter("fitting the photographs", 0.2));
    TOUCHSTONE_ASSIGN_OR_RETURN(p_.photographs, images::MakePhotographs(photographs_, context_.pool));
    TOUCHSTONE_ASSIGN_OR_RETURN(p_.pictures,
                                images::SelectPhotoExplanation(photographs_, p_.photographs, context_));
    Side& side = p_.sides[kPhotographs];
    side.kind = kPhotographs;
    side.given = photographs_.model;
    side.objects = p_.photographs.objects;
    side.alone = p_.pictures.fit;
    side.Prepare(*p_.pictures.fine.experiment, p_.pictures.fine.search->candidates());
    return absl::OkStatus();
  }

  // A fit to every photograph, near the given one, and how much more its pictures scatter than their rows say.
  absl::StatusOr<images::PhotoSearch> PolishRows(const inference::Parameterization& near) const {
    return images::MakePolishRows(*p_.pictures.photographs, near.base(), context_);
  }

  // Values of one effect as one kind alone has them beside its own explanation.
  struct AloneValues {
    inference::Fit fit;
    Eigen::MatrixXd covariance;
    int index = -1;
  };
  absl::StatusOr<AloneValues> FitAlone(const Side& side, const SharedEffect& effect) const {
    std::vector<SharedEffect> shared = side.SharedOf(side.alone);
    if (std::none_of(shared.begin(), shared.end(),
                     [&](const SharedEffect& other) { return other.name() == effect.name(); }))
      shared.push_back(effect);
    inference::Parameterization start =
        side.Free(shared, side.OwnOf(side.alone, static_cast<int>(side.given->effects.size())));
    AloneValues values;
    if (side.kind == kTouches) {
      TOUCHSTONE_ASSIGN_OR_RETURN(values.fit, inference::FitModel(*side.experiment, start));
      values.covariance = values.fit.covariance;
    } else {
      TOUCHSTONE_ASSIGN_OR_RETURN(values.fit, inference::FitModel(*side.experiment, start));
      TOUCHSTONE_ASSIGN_OR_RETURN(const images::PhotoSearch rows, PolishRows(values.fit.model));
      TOUCHSTONE_ASSIGN_OR_RETURN(values.fit, inference::FitModel(*rows.experiment, values.fit.model));
      values.covariance = images::CovarianceBetweenBlocks(*rows.experiment, values.fit);
    }
    values.index = IndexOf(values.fit.model.base(), effect.name());
    return values;
  }

  absl::Status FindConflicts(const SharedSelection& selection) {
    const Part touches = {p_.sides[kTouches].experiment, p_.sides[kTouches].alone.model, 1};
    const Part photographs = {p_.sides[kPhotographs].experiment, p_.sides[kPhotographs].alone.model, 1};
    TOUCHSTONE_ASSIGN_OR_RETURN(const JointFit apart, FitJointly({touches, photographs}, false));
    const double ahead = apart.log_evidence - selection.best.fit.log_evidence;
    if (ahead < kConflictNats) return absl::OkStatus();
    std::vector<SharedEffect> in_doubt;
    for (const Side& side : p_.sides)
      for (const SharedEffect& effect : side.SharedOf(side.alone))
        if (std::none_of(in_doubt.begin(), in_doubt.end(),
                         [&](const SharedEffect& other) { return other.name() == effect.name(); }))
          in_doubt.push_back(effect);
    for (const SharedEffect& effect : in_doubt) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const AloneValues one, FitAlone(p_.sides[kTouches], effect));
      TOUCHSTONE_ASSIGN_OR_RETURN(const AloneValues other, FitAlone(p_.sides[kPhotographs], effect));
      std::vector<std::pair<int, int>> same;
      for (int i = 0; i < one.fit.model.size(); ++i)
        for (int j = 0; j < other.fit.model.size(); ++j)
          if (one.fit.model.parameters()[i].effect == one.index &&
              IsSameValue(one.fit.model, i, other.fit.model, j))
            same.emplace_back(i, j);
      const int n = static_cast<int>(same.size());
      Eigen::VectorXd difference(n);
      Eigen::MatrixXd covariance(n, n);
      for (int a = 0; a < n; ++a) {
        difference[a] = one.fit.point[same[a].first] - other.fit.point[same[a].second];
        for (int b = 0; b < n; ++b)
          covariance(a, b) =
              one.covariance(same[a].first, same[b].first) + other.covariance(same[a].second, same[b].second);
      }
      const double p = WaldP(difference, covariance);
      if (p > kConflictP) continue;
      found_.conflicts.push_back(
          {effect.name(), one.fit.model.Describe(one.index, one.fit.point, one.covariance),
           other.fit.model.Describe(other.index, other.fit.point, other.covariance), p, ahead});
    }
    return absl::OkStatus();
  }

  // What explains as much as the best, with a shared effect in the place of others.
  void FindUndecided(const SharedSelection& selection) {
    for (const Explained& tried : selection.tried) {
      if (tried.fit.log_evidence < selection.best.fit.log_evidence - selection::SearchRules().equivalent_nats)
        continue;
      for (const SharedEffect& effect : tried.shared) {
        const auto same = [&](const auto& other) { return NameOfShared(other) == effect.name(); };
        if (std::any_of(selection.best.shared.begin(), selection.best.shared.end(), same) ||
            std::any_of(found_.undecided.begin(), found_.undecided.end(), same))
          continue;
        std::vector<std::string> instead = OwnBeside(selection.best, tried);
        if (!instead.empty()) found_.undecided.push_back({effect.name(), std::move(instead)});
      }
    }
  }
  static const std::string& NameOfShared(const SharedEffect& effect) { return effect.name(); }
  static const std::string& NameOfShared(const Undecided& undecided) { return undecided.effect; }

  // The joint fit to every photograph, the photographs' noise judged by the scatter between them.
  absl::StatusOr<JointFit> Polish(const Explained& best) const {
    std::array<Part, 2> parts = PartsOf(p_.sides, best);
    TOUCHSTONE_ASSIGN_OR_RETURN(const images::PhotoSearch rows,
                                PolishRows(best.fit.fits[kPhotographs].model));
    const inference::Likelihood plain(rows.rows->GroupRows(), nullptr, 0, nullptr);
    inference::Experiment experiment = *rows.experiment;
    if (best.fit.fits[kPhotographs].hypothesis == 0) experiment.likelihood = &plain;
    parts[kPhotographs].experiment = &experiment;
    TOUCHSTONE_ASSIGN_OR_RETURN(JointFit fit, FitJointly(parts));
    const inference::Fit& pictures = fit.fits[kPhotographs];
    const Eigen::MatrixXd between = images::CovarianceBetweenBlocks(experiment, pictures);
    double factor = 1;
    for (int i = 0; i < pictures.model.size(); ++i)
      if (IsShared(*pictures.model.base().effects[pictures.model.parameters()[i].effect].effect) &&
          pictures.covariance(i, i) > 0)
        factor = std::max(factor, between(i, i) / pictures.covariance(i, i));
    if (factor > 1) {
      parts[kPhotographs].variance_factor = factor;
      TOUCHSTONE_ASSIGN_OR_RETURN(fit, FitJointly(parts));
    }
    return fit;
  }

  absl::Status Describe(const SharedSelection& selection) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const JointFit fit, Polish(selection.best));
    std::vector<SharedEffect> in_place;
    for (const SharedEffect& shared : selection.best.shared) {
      SharedStep step;
      step.effect = shared.name();
      step.given = shared.given;
      step.scope =
          shared.instance.per_object ? selection::EffectScope::kObject : selection::EffectScope::kRig;
      if (!shared.object.empty()) step.words = absl::StrCat("on ", shared.object, " only");
      DescribeValues(shared, fit, &step);
      Judge(selection, shared, &step);
      in_place.push_back(Rounded(WithValues(shared, fit), fit));
      step.model = InPlace(*photographs_.model, in_place);
      found_.steps.push_back(std::move(step));
    }
    found_.in_place = found_.steps.back().model;
    return JudgeUnseen(selection.best.fit, fit);
  }

  absl::Status JudgeUnseen(const JointFit& found, const JointFit& polished) {
    const inference::Fit& touches = polished.fits[kTouches];
    TOUCHSTONE_ASSIGN_OR_RETURN(const double unseen,
                                inference::HeldOutRmseRefitted(p_.workspace->experiment, touches));
    const double seen = std::sqrt(touches.columns.values.col(0).squaredNorm() /
                                  std::max<double>(1, static_cast<double>(touches.columns.values.rows())));
    if (seen > 0) found_.heldout_ratio = std::max(unseen / seen, 1.0);
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const std::vector<image::Photo> expected,
        images::ExpectPhotographs(p_.photographs, found_.in_place, false, context_.pool));
    const images::GreyNoiseFloor floor =
        images::NoiseFloorOfPhotographs(p_.photographs, expected, context_.pool);
    found_.heldout_excess_grey2 =
        images::HeldOutExcess(p_.pictures.fine, found.fits[kPhotographs], p_.photographs, floor.sigma_grey);
    return absl::OkStatus();
  }

  // Digits that the joint standard errors leave.
  SharedEffect Rounded(SharedEffect shared, const JointFit& fit) const {
    for (const Kind kind : kKinds) {
      inference::Fit rounded = fit.fits[kind];
      rounded.covariance = fit.CovarianceOf(kind);
      model::Model model = rounded.model.base();
      selection::RoundValues(rounded, &model);
      const int index = IndexOf(model, shared.name());
      if (index < 0) continue;
      shared.instance.values = model.effects[index].values;
      for (const auto& [object, values] : model.effects[index].object_values)
        shared.instance.object_values[object] = values;
    }
    if (!shared.object.empty()) {
      const std::vector<double> values = shared.instance.object_values[shared.object];
      shared.instance.object_values = {{shared.object, values}};
    }
    return shared;
  }

  void DescribeValues(const SharedEffect& shared, const JointFit& fit, SharedStep* step) const {
    std::array<std::vector<inference::ParameterEstimate>, 2> joint, alone;
    for (const Kind kind : kKinds) {
      const inference::Parameterization& model = fit.fits[kind].model;
      const int index = IndexOf(model.base(), shared.name());
      if (index < 0) continue;
      joint[kind] = model.Describe(index, fit.fits[kind].point, fit.CovarianceOf(kind));
      alone[kind] = model.Describe(index, fit.fits[kind].point, fit.AloneOf(kind));
    }
    const auto same = [](const inference::ParameterEstimate& a, const inference::ParameterEstimate& b) {
      return a.name == b.name && a.entry == b.entry && a.object == b.object;
    };
    for (const Kind kind : kKinds)
      for (size_t i = 0; i < joint[kind].size(); ++i) {
        inference::ParameterEstimate estimate = joint[kind][i];
        auto at = std::find_if(step->parameters.begin(), step->parameters.end(),
                               [&](const inference::ParameterEstimate& e) { return same(e, estimate); });
        if (at == step->parameters.end()) at = step->parameters.insert(step->parameters.end(), estimate);
        if (IsKnown(*shared.instance.effect, alone[kind][i]))
          (kind == kTouches ? at->std_error_touches : at->std_error_photographs) = alone[kind][i].std_error;
      }
    if (!shared.given) return;
    const model::Model& given = *photographs_.model;
    const inference::Parameterization as_given(given, p_.sides[kPhotographs].objects);
    for (const inference::ParameterEstimate& old :
         as_given.Describe(IndexOf(given, shared.name()), Eigen::VectorXd(), Eigen::MatrixXd()))
      for (inference::ParameterEstimate& estimate : step->parameters)
        if (same(estimate, old)) estimate.before = old.value;
  }

  static bool IsKnown(const model::Effect& effect, const inference::ParameterEstimate& estimate) {
    for (const model::ParameterInfo& parameter : effect.parameters)
      if (parameter.name == estimate.name)
        return estimate.std_error > 0 && estimate.std_error < kUnknown * parameter.typical;
    return false;
  }

  // How probable, which kinds show it, what else would do.
  void Judge(const SharedSelection& selection, const SharedEffect& shared, SharedStep* step) const {
    const double best = selection.best.fit.log_evidence;
    std::vector<double> all, same;
    double without = selection.none.fit.log_evidence;
    const auto has = [](const Explained& explained, const std::string& name) {
      return std::any_of(explained.shared.begin(), explained.shared.end(),
                         [&](const SharedEffect& effect) { return effect.name() == name; });
    };
    const auto consider = [&](const Explained& explained) {
      const double evidence = explained.fit.log_evidence;
      all.push_back(evidence);
      if (has(explained, shared.name())) {
        same.push_back(evidence);
        return;
      }
      without = std::max(without, evidence);
      if (evidence < best - selection::SearchRules().equivalent_nats) return;
      same.push_back(evidence);
      for (const SharedEffect& other : explained.shared)
        if (!has(selection.best, other.name())) step->equivalent.push_back(other.name());
      for (const std::string& own : OwnBeside(explained, selection.best)) step->equivalent.push_back(own);
    };
    consider(selection.none);
    for (const Explained& explained : selection.tried) consider(explained);
    std::sort(step->equivalent.begin(), step->equivalent.end());
    step->equivalent.erase(std::unique(step->equivalent.begin(), step->equivalent.end()),
                           step->equivalent.end());
    step->gain_nats = best - without;
    step->probability = selection::ProbabilityOfShare(inference::LogSum(same) - inference::LogSum(all));
    std::array<bool, 2> shows;
    for (const Kind kind : kKinds) shows[kind] = ShownBy(kind, shared.name(), selection.best.fit);
    step->shown_by = shows[kTouches] == shows[kPhotographs] ? "both"
                     : shows[kTouches]                      ? "touches"
                                                            : "photographs";
  }

  // Whether one kind, with everything else in place, has a value that chance would not give it.
  static bool ShownBy(Kind kind, const std::string& name, const JointFit& fit) {
    const inference::Fit& own = fit.fits[kind];
    const int index = IndexOf(own.model.base(), name);
    std::vector<int> members;
    for (int i = 0; i < own.model.size(); ++i)
      if (own.model.parameters()[i].effect == index) members.push_back(i);
    const int n = static_cast<int>(members.size());
    Eigen::VectorXd difference(n);
    Eigen::MatrixXd covariance(n, n);
    for (int a = 0; a < n; ++a) {
      difference[a] = fit.alone[kind][members[a]] - own.model.parameters()[members[a]].neutral;
      for (int b = 0; b < n; ++b) covariance(a, b) = own.covariance(members[a], members[b]);
    }
    return WaldP(difference, covariance) < kShownP;
  }

  const DiagnosisInput& touches_;
  const DiagnosisInput& photographs_;
  DiagnosisContext context_;
  std::mutex mutex_;
  bool cancelled_ = false;
  Prepared p_;
  SharedEffects found_;
};

}  // namespace

absl::StatusOr<SharedEffects> FindSharedEffects(const DiagnosisInput& touches,
                                                const DiagnosisInput& photographs,
                                                const DiagnosisContext& context) {
  return SharedFinder(touches, photographs, context).Run();
}

}  // namespace touchstone::diagnosis::joint
