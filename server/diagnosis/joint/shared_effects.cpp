#include "server/diagnosis/joint/shared_effects.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "server/base/status.h"
#include "server/diagnosis/engine/ladder/hypotheses.h"
#include "server/diagnosis/engine/ladder/ladder.h"
#include "server/diagnosis/joint/conflicts.h"
#include "server/diagnosis/joint/rules.h"

namespace touchstone::diagnosis::joint {
namespace {

// What several kinds together may show beside effects that each names by itself, in the order in which it is asked.
struct JointHypothesis {
  enum { kConflict, kUndecided, kSharedCause };
};
const std::vector<engine::HypothesisRule>& JointHypothesisRules() {
  using J = JointHypothesis;
  using L = engine::Leaves;
  static const auto& rules = *new std::vector<engine::HypothesisRule>{
      // Where one kind wants another value than another, nothing is averaged.
      {J::kConflict, "conflict", L::kMeans, {J::kSharedCause}},
      {J::kUndecided, "undecided", L::kNothing, {}},
      {J::kSharedCause, "shared cause", L::kNothing, {}},
  };
  return rules;
}

class SharedFinder {
 public:
  SharedFinder(const std::vector<const engine::Modality*>& kinds, const model::Model& given,
               const std::function<bool(const std::string&, double)>& progress)
      : kinds_(kinds), given_(given), progress_(progress) {
    const auto is_shared = [this](const model::Effect& effect) {
      return std::count_if(kinds_.begin(), kinds_.end(),
                           [&](const engine::Modality* kind) { return kind->Sees(effect); }) > 1;
    };
    for (size_t kind = 0; kind < kinds.size(); ++kind)
      sides_.emplace_back(*kinds[kind], static_cast<int>(kind), is_shared);
  }

  absl::StatusOr<SharedEffects> Run() {
    found_.in_place = given_;
    found_.heldout.resize(kinds_.size());
    std::set<std::string> settled;
    for (const Side& side : sides_)
      settled.insert(side.settled->settled.begin(), side.settled->settled.end());
    found_.settled.assign(settled.begin(), settled.end());
    TOUCHSTONE_ASSIGN_OR_RETURN(const SharedSelection selection,
                                SearchShared(sides_, [this](const std::string& tried, double done) {
                                  return Enter(tried, kSearched * done);
                                }));
    TOUCHSTONE_RETURN_IF_ERROR(Enter("", kSearched));
    using J = JointHypothesis;
    TOUCHSTONE_RETURN_IF_ERROR(hypotheses_.Ask({{J::kConflict, [&] { return AskConflict(selection); }},
                                                {J::kUndecided, [&] { return FindUndecided(selection); }},
                                                {J::kSharedCause, [&] { return Describe(selection); }}}));
    return std::move(found_);
  }

 private:
  static constexpr double kSearched = 0.9;  // of the progress

  // `tried`: an effect; empty: none.
  absl::Status Enter(const std::string& tried, double done) const {
    const std::string stage = absl::StrCat("fitting both together", tried.empty() ? "" : ": ", tried);
    return !progress_ || progress_(stage, done) ? absl::OkStatus()
                                                : absl::CancelledError("the diagnosis was cancelled");
  }

  absl::Status AskConflict(const SharedSelection& selection) {
    TOUCHSTONE_ASSIGN_OR_RETURN(found_.conflicts, FindConflicts(sides_, selection));
    return hypotheses_.AddIf(!found_.conflicts.empty(), JointHypothesis::kConflict);
  }

  // What explains as much as the best, with a shared effect in the place of others.
  absl::Status FindUndecided(const SharedSelection& selection) {
    for (const JointExplanation& tried : selection.tried) {
      if (tried.fit.log_evidence < selection.best.fit.log_evidence - engine::SearchRules().equivalent_nats)
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
    return absl::OkStatus();
  }
  static const std::string& NameOfShared(const SharedEffect& effect) { return effect.name(); }
  static const std::string& NameOfShared(const Undecided& undecided) { return undecided.effect; }

  // The joint fit to all rows, where a kind's values are taken from others than its search; the noise of each kind judged by
  // the scatter between its blocks.
  absl::StatusOr<JointFit> Polish(const JointExplanation& best) const {
    std::vector<Part> parts = PartsOf(sides_, best);
    std::vector<engine::FinalRows> rows;
    for (const Side& side : sides_) {
      TOUCHSTONE_ASSIGN_OR_RETURN(engine::FinalRows near, side.modality->RowsNear(best.fit.fits[side.kind]));
      rows.push_back(std::move(near));
    }
    for (const Side& side : sides_) parts[side.kind].experiment = &rows[side.kind].experiment;
    TOUCHSTONE_ASSIGN_OR_RETURN(JointFit fit, FitJointly(parts));
    bool again = false;
    for (const Side& side : sides_) {
      const engine::Fit& own = fit.fits[side.kind];
      const Eigen::MatrixXd between = side.modality->CovarianceOf(rows[side.kind].experiment, own);
      double& factor = parts[side.kind].variance_factor;
      for (int i = 0; i < own.model.size(); ++i)
        if (side.is_shared(*own.model.base().effects[own.model.parameters()[i].effect].effect) &&
            own.covariance(i, i) > 0)
          factor = std::max(factor, between(i, i) / own.covariance(i, i));
      again |= factor > 1;
    }
    if (!again) return fit;
    return FitJointly(parts);
  }

  absl::Status Describe(const SharedSelection& selection) {
    if (selection.best.shared.empty()) return absl::OkStatus();
    TOUCHSTONE_RETURN_IF_ERROR(Enter("the values", kSearched));
    TOUCHSTONE_ASSIGN_OR_RETURN(const JointFit fit, Polish(selection.best));
    std::vector<SharedEffect> in_place;
    for (const SharedEffect& shared : selection.best.shared) {
      SharedStep step;
      step.effect = shared.name();
      step.given = shared.given;
      step.scope = shared.instance.per_object ? engine::EffectScope::kObject : engine::EffectScope::kRig;
      if (!shared.object.empty()) step.words = absl::StrCat("on ", shared.object, " only");
      DescribeValues(shared, fit, &step);
      AssessStep(selection, shared, &step);
      in_place.push_back(Rounded(WithValues(shared, fit), fit));
      step.model = InPlace(given_, in_place);
      found_.steps.push_back(std::move(step));
    }
    found_.in_place = found_.steps.back().model;
    return MeasureHeldOut(selection.best.fit, fit);
  }

  absl::Status MeasureHeldOut(const JointFit& found, const JointFit& polished) {
    for (const Side& side : sides_) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const engine::HeldOutError error,
                                  side.modality->HeldOut(found.fits[side.kind], polished.fits[side.kind]));
      found_.heldout[side.kind] = error;
    }
    return absl::OkStatus();
  }

  // Digits that the joint standard errors leave.
  SharedEffect Rounded(SharedEffect shared, const JointFit& fit) const {
    for (int kind = 0; kind < static_cast<int>(sides_.size()); ++kind) {
      engine::Fit rounded = fit.fits[kind];
      rounded.covariance = fit.CovarianceOf(kind);
      model::Model model = rounded.model.base();
      engine::RoundValues(rounded, &model);
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
    std::vector<std::vector<engine::ParameterEstimate>> joint(sides_.size()), alone(sides_.size());
    for (int kind = 0; kind < static_cast<int>(sides_.size()); ++kind) {
      const engine::Parameterization& model = fit.fits[kind].model;
      const int index = IndexOf(model.base(), shared.name());
      if (index < 0) continue;
      joint[kind] = model.Describe(index, fit.fits[kind].point, fit.CovarianceOf(kind));
      alone[kind] = model.Describe(index, fit.fits[kind].point, fit.AloneOf(kind));
    }
    const auto same = [](const engine::ParameterEstimate& a, const engine::ParameterEstimate& b) {
      return a.name == b.name && a.entry == b.entry && a.object == b.object;
    };
    for (int kind = 0; kind < static_cast<int>(sides_.size()); ++kind)
      for (size_t i = 0; i < joint[kind].size(); ++i) {
        engine::ParameterEstimate estimate = joint[kind][i];
        auto at = std::find_if(step->parameters.begin(), step->parameters.end(),
                               [&](const engine::ParameterEstimate& e) { return same(e, estimate); });
        if (at == step->parameters.end()) at = step->parameters.insert(step->parameters.end(), estimate);
        if (IsKnown(*shared.instance.effect, alone[kind][i]))
          at->std_error_alone.emplace_back(kinds_[kind]->name(), alone[kind][i].std_error);
      }
    if (!shared.given) return;
    std::set<std::string> objects;
    for (const engine::Modality* kind : kinds_)
      objects.insert(kind->objects().begin(), kind->objects().end());
    const engine::Parameterization as_given(given_, {objects.begin(), objects.end()});
    for (const engine::ParameterEstimate& old :
         as_given.Describe(IndexOf(given_, shared.name()), Eigen::VectorXd(), Eigen::MatrixXd()))
      for (engine::ParameterEstimate& estimate : step->parameters)
        if (same(estimate, old)) estimate.before = old.value;
  }

  static bool IsKnown(const model::Effect& effect, const engine::ParameterEstimate& estimate) {
    for (const model::ParameterInfo& parameter : effect.parameters)
      if (parameter.name == estimate.name)
        return estimate.std_error > 0 &&
               estimate.std_error < kJointRules.max_unknown_over_typical * parameter.typical;
    return false;
  }

  // How probable, which kinds show it, what else would do.
  void AssessStep(const SharedSelection& selection, const SharedEffect& shared, SharedStep* step) const {
    const double best = selection.best.fit.log_evidence;
    std::vector<double> all, same;
    double without = selection.none.fit.log_evidence;
    const auto has = [](const JointExplanation& explained, const std::string& name) {
      return std::any_of(explained.shared.begin(), explained.shared.end(),
                         [&](const SharedEffect& effect) { return effect.name() == name; });
    };
    const auto consider = [&](const JointExplanation& explained) {
      const double evidence = explained.fit.log_evidence;
      all.push_back(evidence);
      if (has(explained, shared.name())) {
        same.push_back(evidence);
        return;
      }
      without = std::max(without, evidence);
      if (evidence < best - engine::SearchRules().equivalent_nats) return;
      same.push_back(evidence);
      for (const SharedEffect& other : explained.shared)
        if (!has(selection.best, other.name())) step->equivalent.push_back(other.name());
      for (const std::string& own : OwnBeside(explained, selection.best)) step->equivalent.push_back(own);
    };
    consider(selection.none);
    for (const JointExplanation& explained : selection.tried) consider(explained);
    std::sort(step->equivalent.begin(), step->equivalent.end());
    step->equivalent.erase(std::unique(step->equivalent.begin(), step->equivalent.end()),
                           step->equivalent.end());
    step->gain_nats = best - without;
    step->probability = engine::ProbabilityAmong(same, all);
    std::vector<std::string> shown_by;
    for (const Side& side : sides_)
      if (ShownBy(side.kind, shared.name(), selection.best.fit)) shown_by.push_back(side.modality->name());
    step->shown_by = absl::StrJoin(shown_by, ", ");
    if (shown_by.empty() || shown_by.size() == sides_.size())
      step->shown_by = sides_.size() == 2 ? "both" : "all";
  }

  // Whether one kind, with everything else in place, has a value that chance would not give it.
  static bool ShownBy(int kind, const std::string& name, const JointFit& fit) {
    const engine::Fit& own = fit.fits[kind];
    return engine::NeutralP(own.model, IndexOf(own.model.base(), name), fit.alone[kind], own.covariance) <
           kJointRules.shown_p;
  }

  const std::vector<const engine::Modality*>& kinds_;
  const model::Model& given_;
  const std::function<bool(const std::string&, double)>& progress_;
  Sides sides_;
  SharedEffects found_;
  engine::Hypotheses hypotheses_{JointHypothesisRules()};
};

}  // namespace

absl::StatusOr<SharedEffects> FindSharedEffects(
    const std::vector<const engine::Modality*>& kinds, const model::Model& given,
    const std::function<bool(const std::string& stage, double done)>& progress) {
  return SharedFinder(kinds, given, progress).Run();
}

}  // namespace touchstone::diagnosis::joint
