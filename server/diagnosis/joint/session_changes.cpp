#include "server/diagnosis/joint/session_changes.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "server/base/numbers/normal.h"
#include "server/base/status.h"
#include "server/diagnosis/engine/ladder/ladder.h"

namespace touchstone::diagnosis::joint {
namespace {

// The effects that the sessions are compared in: the given model's, and those that any session names.
std::vector<SharedEffect> EffectsOf(const std::vector<Side>& sides, const ClaimedEffects& claimed) {
  std::vector<SharedEffect> effects;
  const model::Model& given = sides[0].given();
  for (const model::EffectInstance& instance : given.effects)
    if (sides[0].modality->Sees(*instance.effect) && !instance.effect->random() &&
        !instance.effect->parameters.empty())
      effects.push_back({instance, true, ""});
  for (const Side& side : sides) {
    for (const SharedEffect& found : side.SharedOf(side.modality->alone())) {
      const auto& candidates = side.modality->candidates();
      // A curve without a name is no cause that sessions could share.
      const bool named = std::any_of(candidates.begin(), candidates.end(), [&](const engine::Candidate& c) {
        return !c.nameless && engine::NameOf(*c.effect) == found.name();
      });
      if (found.given || !named) continue;
      if (!claimed.empty() && claimed[side.kind].count(found.name()) == 0) continue;
      const auto same = std::find_if(effects.begin(), effects.end(),
                                     [&](const SharedEffect& e) { return e.name() == found.name(); });
      if (same == effects.end()) {
        effects.push_back({found.instance, false, found.object, found.rare});
        continue;
      }
      if (same->instance.per_object == found.instance.per_object && same->object == found.object) continue;
      // One session shows it on one object, another elsewhere or everywhere: each object has its own.
      same->instance.per_object = true;
      same->object.clear();
      for (const auto& [object, values] : found.instance.object_values)
        same->instance.object_values.emplace(object, values);
    }
  }
  return effects;
}

class ChangeFinder {
 public:
  ChangeFinder(const std::vector<const engine::Modality*>& sessions, const ClaimedEffects& claimed,
               const std::function<bool(double)>& progress)
      : progress_(progress) {
    for (size_t session = 0; session < sessions.size(); ++session)
      sides_.emplace_back(*sessions[session], static_cast<int>(session),
                          [](const model::Effect&) { return true; });
    effects_ = EffectsOf(sides_, claimed);
  }

  absl::StatusOr<SessionChanges> Run() {
    TOUCHSTONE_RETURN_IF_ERROR(Enter(0));
    TOUCHSTONE_ASSIGN_OR_RETURN(evidence_, SessionEvidence::Create(sides_, effects_));
    TOUCHSTONE_RETURN_IF_ERROR(Enter(0.4));
    choice_.emplace(*evidence_);
    TOUCHSTONE_ASSIGN_OR_RETURN(const JointFit fit, FitWith(Kept()));
    TOUCHSTONE_RETURN_IF_ERROR(Enter(0.6));
    for (size_t group = 0; group < evidence_->groups().size(); ++group)
      if (!IsAbsent(static_cast<int>(group)))
        found_.effects.push_back(DescribeGroup(*evidence_, *choice_, static_cast<int>(group)));
    found_.models = ModelsOf(fit, Kept());
    TOUCHSTONE_RETURN_IF_ERROR(AddSteps(fit));
    AddRefitted(fit);
    TOUCHSTONE_RETURN_IF_ERROR(Enter(0.8));
    for (const Side& side : sides_) {
      engine::HeldOutError error;
      if (found_.moved()) {
        TOUCHSTONE_ASSIGN_OR_RETURN(error, side.modality->HeldOut(fit.fits[side.kind], fit.fits[side.kind]));
      }
      found_.heldout.push_back(error);
    }
    return std::move(found_);
  }

 private:
  absl::Status Enter(double done) const {
    return !progress_ || progress_(done) ? absl::OkStatus()
                                         : absl::CancelledError("the diagnosis was cancelled");
  }

  const ValueGroup& group(int index) const { return evidence_->groups()[index]; }
  int groups() const { return static_cast<int>(evidence_->groups().size()); }
  SessionValues state(int group) const { return choice_->state(group); }
  // An effect that the given model lacks, and that the sessions do without.
  bool IsAbsent(int index) const { return !group(index).given && state(index) == SessionValues::kGiven; }

  // Effects with a value that is not the given one.
  std::vector<SharedEffect> Kept() const {
    std::vector<SharedEffect> kept;
    for (const SharedEffect& effect : effects_)
      for (int g = 0; g < groups(); ++g)
        if (group(g).effect == effect.name() && state(g) != SessionValues::kGiven) {
          kept.push_back(effect);
          break;
        }
    return kept;
  }

  bool IsOwn(const engine::Parameterization& model, int parameter) const {
    const engine::FreeParameter& p = model.parameters()[parameter];
    const std::string name = engine::NameOf(*model.base().effects[p.effect].effect);
    for (int g = 0; g < groups(); ++g)
      if (group(g).effect == name && group(g).object == p.object) return state(g) == SessionValues::kOwn;
    return false;
  }

  // With the values that were chosen: a joint fit takes the smooth error that fits best where it starts.
  engine::Parameterization StartOf(const Side& side, const std::vector<SharedEffect>& effects) const {
    engine::Parameterization start = side.Free(effects, {});
    const engine::Parameterization& known = evidence_->fit(side.kind).model;
    const Eigen::VectorXd chosen = evidence_->PointOf(choice_->chosen(), side.kind);
    Eigen::VectorXd point = start.Start();
    for (int j = 0; j < start.size(); ++j)
      for (int i = 0; i < known.size(); ++i)
        if (IsSameValue(known, i, start, j)) point[j] = chosen[i];
    start.MoveTo(start.Clip(point));
    return start;
  }

  absl::StatusOr<JointFit> FitWith(const std::vector<SharedEffect>& effects) const {
    std::vector<Part> parts;
    for (const Side& side : sides_)
      parts.push_back(
          {&side.modality->experiment(), StartOf(side, effects), evidence_->variance_factor(side.kind)});
    return FitJointly(parts, [this](const engine::Parameterization& model, int parameter) {
      return IsOwn(model, parameter);
    });
  }

  // The given model with the fitted values, by session; values of objects that a session lacks are another's.
  std::vector<model::Model> ModelsOf(const JointFit& fit, const std::vector<SharedEffect>& effects) const {
    std::vector<model::Model> rounded;
    for (const Side& side : sides_) {
      engine::Fit own = fit.fits[side.kind];
      own.covariance = fit.CovarianceOf(side.kind);
      rounded.push_back(own.model.base());
      engine::RoundValues(own, &rounded.back());
    }
    std::vector<model::Model> models;
    for (const Side& side : sides_) {
      std::vector<SharedEffect> in_place = effects;
      for (SharedEffect& effect : in_place) {
        std::vector<int> order = {side.kind};
        for (const Side& other : sides_)
          if (other.kind != side.kind) order.push_back(other.kind);
        bool first = true;
        for (const int session : order) {
          const int index = IndexOf(rounded[session], effect.name());
          if (index < 0) continue;
          const model::EffectInstance& from = rounded[session].effects[index];
          if (first) effect.instance = from;
          for (const auto& [object, values] : from.object_values)
            effect.instance.object_values.emplace(object, values);
          first = false;
        }
      }
      models.push_back(InPlace(side.given(), in_place));
    }
    return models;
  }

  // Effects that were added, each with its gain over doing without it; the rungs are fitted with the simulator.
  absl::Status AddSteps(const JointFit& whole) {
    std::vector<SharedEffect> given, open;
    for (const SharedEffect& effect : Kept()) (effect.given ? given : open).push_back(effect);
    std::vector<SharedEffect> in_place = given;
    while (!open.empty()) {
      size_t best = 0;
      double most = -INFINITY;
      for (size_t i = 0; i < open.size(); ++i) {
        std::vector<SharedEffect> with = in_place;
        with.push_back(open[i]);
        const double evidence = evidence_->Of(OnlyWith(with)).log_evidence;
        if (evidence > most) most = evidence, best = i;
      }
      in_place.push_back(open[best]);
      open.erase(open.begin() + static_cast<long>(best));
      SessionStep step;
      step.effect = in_place.back().name();
      AssessStep(&step);
      DescribeLast(in_place.back(), whole, &step.parameters);
      if (open.empty()) {
        step.models = found_.models;
      } else {
        TOUCHSTONE_ASSIGN_OR_RETURN(const JointFit fit, FitWith(in_place));
        step.models = ModelsOf(fit, in_place);
      }
      found_.steps.push_back(std::move(step));
    }
    return absl::OkStatus();
  }

  // The states with only these of the effects that were added.
  SessionStates OnlyWith(const std::vector<SharedEffect>& effects) const {
    SessionStates states = choice_->states();
    for (int g = 0; g < groups(); ++g)
      if (!group(g).given && std::none_of(effects.begin(), effects.end(),
                                          [&](const SharedEffect& e) { return e.name() == group(g).effect; }))
        states[g] = SessionValues::kGiven;
    return states;
  }

  void AssessStep(SessionStep* step) const {
    SessionStates without = choice_->states();
    for (int g = 0; g < groups(); ++g)
      if (group(g).effect == step->effect) without[g] = SessionValues::kGiven;
    step->gain_nats = choice_->chosen().log_evidence - evidence_->Of(without).log_evidence;
    bool first = true;
    for (const Side& side : sides_) {
      const engine::SelectedStep* found = side.modality->FoundAlone(step->effect);
      if (found == nullptr) continue;
      step->probability = std::max(step->probability, found->probability);
      std::vector<std::string> names;
      for (const engine::CompetingEffect& other : found->competing)
        if (other.equivalent && other.name != step->effect &&
            std::find(names.begin(), names.end(), other.name) == names.end() &&
            (first || std::find(step->equivalent.begin(), step->equivalent.end(), other.name) !=
                          step->equivalent.end()))
          names.push_back(other.name);
      step->equivalent = std::move(names);
      first = false;
    }
  }

  // As the last session that has it has it.
  void DescribeLast(const SharedEffect& effect, const JointFit& fit,
                    std::vector<engine::ParameterEstimate>* parameters) const {
    for (int session = static_cast<int>(sides_.size()) - 1; session >= 0 && parameters->empty(); --session) {
      const engine::Fit& own = fit.fits[session];
      const int index = IndexOf(own.model.base(), effect.name());
      if (index >= 0) *parameters = own.model.Describe(index, own.point, fit.CovarianceOf(session));
    }
  }

  void AddRefitted(const JointFit& fit) {
    for (const SharedEffect& effect : Kept()) {
      if (!effect.given) continue;
      engine::RefittedEffect refit = {effect.name(), {}};
      DescribeLast(effect, fit, &refit.parameters);
      const Side& last = sides_.back();
      const engine::Parameterization as_given(last.given(), last.modality->objects());
      for (const engine::ParameterEstimate& old :
           as_given.Describe(IndexOf(last.given(), effect.name()), {}, {}))
        for (engine::ParameterEstimate& estimate : refit.parameters)
          if (estimate.name == old.name && estimate.entry == old.entry && estimate.object == old.object)
            estimate.before = old.value;
      found_.refitted.push_back(std::move(refit));
    }
  }

  const std::function<bool(double)>& progress_;
  std::vector<Side> sides_;
  std::vector<SharedEffect> effects_;
  std::optional<SessionEvidence> evidence_;
  std::optional<SessionChoice> choice_;
  SessionChanges found_;
};

}  // namespace

bool SessionChanges::changed() const {
  return std::any_of(effects.begin(), effects.end(),
                     [](const ComparedEffect& effect) { return effect.values == SessionValues::kOwn; });
}

absl::StatusOr<SessionChanges> FindSessionChanges(const std::vector<const engine::Modality*>& sessions,
                                                  const ClaimedEffects& claimed,
                                                  const std::function<bool(double done)>& progress) {
  return ChangeFinder(sessions, claimed, progress).Run();
}

}  // namespace touchstone::diagnosis::joint
