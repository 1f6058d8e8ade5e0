#include "server/diagnosis/joint/session_changes.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "server/base/normal.h"
#include "server/base/status.h"
#include "server/diagnosis/engine/ladder.h"

namespace touchstone::diagnosis::joint {
namespace {

constexpr double kChangedErrors = 3;     // of a single entry, where its effect has changed
constexpr double kGradientStep = 1e-4;   // over the parameter's scale

// The effects that the sessions are compared in: the given model's, and those that any session names.
std::vector<SharedEffect> EffectsOf(const std::vector<Side>& sides) {
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

// How far each entry of a description moves with each of the session's values; the entries' unit over SI.
Eigen::MatrixXd GradientsOf(const engine::Parameterization& model, int effect, const Eigen::VectorXd& point) {
  const std::vector<engine::ParameterEstimate> at = model.Describe(effect, point, {});
  Eigen::MatrixXd gradients = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(at.size()), model.size());
  for (int i = 0; i < model.size(); ++i) {
    const engine::FreeParameter& parameter = model.parameters()[i];
    if (parameter.effect != effect) continue;
    double step = kGradientStep * parameter.scale;
    if (point[i] + step > parameter.upper) step = -step;
    Eigen::VectorXd moved = point;
    moved[i] += step;
    const std::vector<engine::ParameterEstimate> there = model.Describe(effect, moved, {});
    for (size_t e = 0; e < at.size(); ++e)
      gradients(static_cast<Eigen::Index>(e), i) = (there[e].value - at[e].value) / step;
  }
  return gradients;
}

// One effect of one session, described.
struct DescribedSession {
  int session = 0;
  std::vector<engine::ParameterEstimate> entries;  // of the group
  Eigen::MatrixXd gradients;                       // entries x the session's values
  std::vector<double> moves;  // the rows, over the noise, by one unit of each entry
};

class ChangeFinder {
 public:
  ChangeFinder(const std::vector<const engine::Modality*>& sessions,
               const std::function<bool(double)>& progress)
      : progress_(progress) {
    for (size_t session = 0; session < sessions.size(); ++session)
      sides_.emplace_back(*sessions[session], static_cast<int>(session),
                          [](const model::Effect&) { return true; });
    effects_ = EffectsOf(sides_);
  }

  absl::StatusOr<SessionChanges> Run() {
    TOUCHSTONE_RETURN_IF_ERROR(Enter(0));
    TOUCHSTONE_ASSIGN_OR_RETURN(evidence_, SessionEvidence::Create(sides_, effects_));
    TOUCHSTONE_RETURN_IF_ERROR(Enter(0.4));
    choice_.emplace(*evidence_);
    TOUCHSTONE_ASSIGN_OR_RETURN(const JointFit fit, FitWith(Kept()));
    TOUCHSTONE_RETURN_IF_ERROR(Enter(0.6));
    for (size_t group = 0; group < evidence_->groups().size(); ++group)
      if (!IsAbsent(static_cast<int>(group))) found_.effects.push_back(Compared(static_cast<int>(group)));
    found_.models = ModelsOf(fit, Kept());
    TOUCHSTONE_RETURN_IF_ERROR(AddSteps(fit));
    AddRefitted(fit);
    TOUCHSTONE_RETURN_IF_ERROR(Enter(0.8));
    for (const Side& side : sides_) {
      engine::HeldOutError error;
      if (found_.moved()) {
        TOUCHSTONE_ASSIGN_OR_RETURN(error,
                                    side.modality->HeldOut(fit.fits[side.kind], fit.fits[side.kind]));
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
      parts.push_back({&side.modality->experiment(), StartOf(side, effects),
                       evidence_->variance_factor(side.kind)});
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

  // The group's values where each session has its own, all else as found.
  ComparedEffect Compared(int g) const {
    ComparedEffect compared;
    compared.effect = group(g).effect;
    compared.object = group(g).object;
    compared.given = group(g).given;
    compared.values = state(g);
    const SharedEvidence one =
        evidence_->Of(WithState(choice_->states(), g, SessionValues::kShared));
    const SharedEvidence apart = evidence_->Of(WithState(choice_->states(), g, SessionValues::kOwn));
    if (choice_->IsCompared(g)) {
      compared.p = choice_->PApart(one, apart);
      compared.gain_nats = apart.log_evidence - one.log_evidence;
    }
    if (state(g) == SessionValues::kOwn) compared.equivalent = choice_->EquivalentChanges(g);
    DescribeEntries(g, apart, &compared);
    return compared;
  }

  DescribedSession Described(int g, int session, const SharedEvidence& apart) const {
    const engine::Parameterization& model = evidence_->fit(session).model;
    const int effect = IndexOf(model.base(), group(g).effect);
    const Eigen::VectorXd point = evidence_->PointOf(apart, session);
    const std::vector<engine::ParameterEstimate> all =
        model.Describe(effect, point, evidence_->CovarianceOf(apart, session, session));
    const Eigen::MatrixXd gradients = GradientsOf(model, effect, point);
    DescribedSession described;
    described.session = session;
    described.gradients.resize(0, model.size());
    for (size_t e = 0; e < all.size(); ++e) {
      if (all[e].object != group(g).object) continue;
      described.entries.push_back(all[e]);
      described.gradients.conservativeResize(described.gradients.rows() + 1, Eigen::NoChange);
      const Eigen::RowVectorXd gradient = gradients.row(static_cast<Eigen::Index>(e));
      described.gradients.bottomRows(1) = gradient;
      double moves = 0;
      for (int i = 0; i < model.size(); ++i)
        if (gradient[i] != 0)
          moves += std::pow(gradient[i] / gradient.squaredNorm() * evidence_->MovesRows(session, i), 2);
      described.moves.push_back(std::sqrt(moves));
    }
    return described;
  }

  void DescribeEntries(int g, const SharedEvidence& apart, ComparedEffect* compared) const {
    std::vector<DescribedSession> sessions;
    for (const int session : group(g).sessions) sessions.push_back(Described(g, session, apart));
    double most = 0;
    std::vector<double> errors;
    for (size_t e = 0; e < sessions[0].entries.size(); ++e) {
      ComparedValue value;
      value.by_session.resize(sides_.size());
      for (const DescribedSession& described : sessions)
        value.by_session[described.session] = described.entries[e];
      double farthest = -1;
      for (size_t b = 1; b < sessions.size(); ++b)
        for (size_t a = 0; a < b; ++a) CompareTwo(sessions[a], sessions[b], e, apart, &farthest, &value);
      errors.push_back(std::max(farthest, 0.0));
      most = std::max(most, errors.back());
      compared->entries.push_back(std::move(value));
    }
    for (size_t e = 0; e < compared->entries.size(); ++e) {
      ComparedValue& value = compared->entries[e];
      if (state(g) == SessionValues::kOwn && (errors[e] == most || errors[e] >= kChangedErrors))
        value.change = ValueChange::kChanged;
      else if (choice_->IsCompared(g) && value.std_error > 0)
        value.change = Unmoved(sessions, e, value) ? ValueChange::kUnchanged : ValueChange::kCannotSay;
    }
  }

  // Sets the difference of two sessions where it is farther from zero than those so far.
  void CompareTwo(const DescribedSession& from, const DescribedSession& to, size_t entry,
                  const SharedEvidence& apart, double* farthest, ComparedValue* value) const {
    const auto e = static_cast<Eigen::Index>(entry);
    const auto covariance = [&](const DescribedSession& one, const DescribedSession& other) {
      return one.gradients.row(e).dot(evidence_->CovarianceOf(apart, one.session, other.session) *
                                      other.gradients.row(e).transpose());
    };
    const double variance = covariance(from, from) + covariance(to, to) - 2 * covariance(from, to);
    const double difference = to.entries[entry].value - from.entries[entry].value;
    const double std_error = std::sqrt(std::max(variance, 0.0));
    const double errors = std_error > 0 ? std::abs(difference) / std_error : 0;
    if (errors <= *farthest) return;
    *farthest = errors;
    value->from = from.session, value->to = to.session;
    value->difference = difference, value->std_error = std_error;
    value->lower = difference - kNormalQuantile975 * std_error;
    value->upper = difference + kNormalQuantile975 * std_error;
  }

  // Whether no difference in the interval would move rows by more than their noise.
  static bool Unmoved(const std::vector<DescribedSession>& sessions, size_t entry,
                      const ComparedValue& value) {
    double moves = 0;
    for (const DescribedSession& described : sessions) moves = std::max(moves, described.moves[entry]);
    return moves * std::max(std::abs(value.lower), std::abs(value.upper)) <= 1;
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
      Judge(&step);
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
      if (!group(g).given && std::none_of(effects.begin(), effects.end(), [&](const SharedEffect& e) {
            return e.name() == group(g).effect;
          }))
        states[g] = SessionValues::kGiven;
    return states;
  }

  void Judge(SessionStep* step) const {
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
                                                  const std::function<bool(double done)>& progress) {
  return ChangeFinder(sessions, progress).Run();
}

}  // namespace touchstone::diagnosis::joint
