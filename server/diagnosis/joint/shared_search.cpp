#include "server/diagnosis/joint/shared_search.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <optional>

#include "server/base/numbers/distributions.h"
#include "server/base/status.h"
#include "server/diagnosis/engine/fit/held_out.h"
#include "server/diagnosis/engine/search/rules.h"
#include "server/diagnosis/joint/rules.h"

namespace touchstone::diagnosis::joint {
namespace {

constexpr double kWithout = 0.1;  // of the progress: the explanation without any shared effect

engine::SearchRules Rules() {
  return {};
}

// A form of a shared effect with the evidence that each kind expects of it by itself, linearly.
struct Form {
  SharedEffect effect;
  std::vector<double> gain_nats;
  bool named = false;  // by the explanation of one kind alone

  double Sum() const { return std::accumulate(gain_nats.begin(), gain_nats.end(), 0.0); }
  int GainingKinds() const {
    return static_cast<int>(std::count_if(gain_nats.begin(), gain_nats.end(),
                                          [](double nats) { return nats >= kJointRules.worth_trying_nats; }));
  }
  bool IsWorthTrying() const {
    return named || std::max(*std::max_element(gain_nats.begin(), gain_nats.end()), Sum()) >
                        kJointRules.worth_trying_nats;
  }
};

SharedEffect FormOf(const Side& side, const engine::Extension& extension) {
  SharedEffect effect;
  if (extension.candidate < 0) {
    effect.given = true;
    effect.instance = side.given().effects[IndexOf(side.given(), extension.name)];
    return effect;
  }
  const engine::Candidate& candidate = side.search->candidates()[extension.candidate];
  effect.instance.effect = candidate.effect;
  effect.instance.values = candidate.effect->NeutralValues(side.given().fingers);
  effect.instance.per_object =
      candidate.per_object || candidate.effect->always_per_object || !candidate.object.empty();
  effect.object = candidate.object;
  effect.rare = candidate.rare;
  return effect;
}

// Every form that the explanation lacks, most promising first.
absl::StatusOr<std::vector<Form>> ListForms(const Sides& sides, const JointExplanation& so_far) {
  std::map<std::string, Form> forms;
  for (const Side& side : sides) {
    const engine::Fit& fit = so_far.fit.fits[side.kind];
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<engine::Extension> extensions,
                                side.search->Score(fit, side.initial_effects()));
    for (const engine::Extension& extension : extensions) {
      const bool shared =
          extension.candidate >= 0
              ? side.is_shared(*side.search->candidates()[extension.candidate].effect)
              : side.is_shared(*side.given().effects[IndexOf(side.given(), extension.name)].effect);
      if (!shared || !extension.visible) continue;
      const SharedEffect effect = FormOf(side, extension);
      Form& form =
          forms.emplace(effect.Key(), Form{effect, std::vector<double>(sides.size()), false}).first->second;
      form.gain_nats[side.kind] = extension.log_evidence - fit.log_evidence;
    }
    for (const SharedEffect& effect : side.SharedOf(side.modality->alone())) {
      const bool present = std::any_of(so_far.shared.begin(), so_far.shared.end(),
                                       [&](const SharedEffect& e) { return e.name() == effect.name(); });
      if (present) continue;
      Form& form =
          forms.emplace(effect.Key(), Form{effect, std::vector<double>(sides.size()), false}).first->second;
      form.named = true;
      // Where that kind has it is where the joint fit starts.
      form.effect.instance = effect.instance;
    }
  }
  std::vector<Form> list;
  for (auto& [key, form] : forms)
    if (form.IsWorthTrying()) list.push_back(std::move(form));
  std::stable_sort(list.begin(), list.end(), [](const Form& a, const Form& b) {
    return a.named != b.named ? a.named : a.Sum() > b.Sum();
  });
  const auto named = std::count_if(list.begin(), list.end(), [](const Form& form) { return form.named; });
  if (list.size() > static_cast<size_t>(named + kJointRules.max_tried))
    list.resize(named + kJointRules.max_tried);
  return list;
}

// Adds forms that promise nothing only because each kind names effects of its own that do the same: a sag of the tool and a
// camera that stands lower are, together, objects that lie lower.
absl::Status AddFormsHiddenByOwn(const Sides& sides, const std::vector<OwnEffects>& own,
                                 std::vector<Form>* forms) {
  if (std::count_if(own.begin(), own.end(), [](const OwnEffects& e) { return e.size() > 0; }) < 2)
    return absl::OkStatus();
  JointExplanation bare;
  bare.own.resize(sides.size());
  TOUCHSTONE_ASSIGN_OR_RETURN(bare.fit, FitJointly(PartsOf(sides, bare)));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<Form> hidden, ListForms(sides, bare));
  for (const Form& form : hidden) {
    // What only one kind would gain from stands for nothing of the others'.
    if (form.GainingKinds() < 2) continue;
    if (std::none_of(forms->begin(), forms->end(),
                     [&](const Form& other) { return other.effect.Key() == form.effect.Key(); }))
      forms->push_back(form);
  }
  return absl::OkStatus();
}

// Whether one kind, at the joint values, predicts blocks better that were left out.
bool PredictsUnseen(const Sides& sides, const JointExplanation& before, const JointExplanation& after) {
  for (const Side& side : sides) {
    const double was = engine::HeldOutRmseByBlock(side.modality->experiment(), before.fit.fits[side.kind]);
    const double is = engine::HeldOutRmseByBlock(side.modality->experiment(), after.fit.fits[side.kind]);
    if (is < (1 - Rules().min_relative_cv_gain) * was) return true;
  }
  return false;
}

bool IsWorthIt(const Sides& sides, const JointExplanation& before, const JointExplanation& after,
               size_t forms) {
  const bool rare = after.shared.back().rare;
  const double gain = after.fit.log_evidence - before.fit.log_evidence;
  // Where it takes the place of what a kind named by itself, nothing is added but one cause put for others.
  int replaced = 0;
  for (size_t kind = 0; kind < before.own.size(); ++kind)
    replaced += before.own[kind].size() - after.own[kind].size();
  // One cause for several needs no more than to explain as much: the several would each have had to be worth its entry.
  if (replaced > 1) return gain > -Rules().equivalent_nats;
  if (replaced > 0)
    return gain > (after.fit.parameters.size() > before.fit.parameters.size()
                       ? Rules().swap_nats
                       : engine::kCandidateRules.swap_equal_nats.value());
  if (gain < (rare ? Rules().enter_rare_nats : Rules().enter_nats)) return false;
  const int added = std::max(
      static_cast<int>(after.fit.parameters.size()) - static_cast<int>(before.fit.parameters.size()), 1);
  const double ratio = 2 * (after.fit.log_likelihood - before.fit.log_likelihood);
  if (static_cast<double>(forms) * ChiSquaredTail(ratio, added) > Rules().family_wise_p) return false;
  return PredictsUnseen(sides, before, after);
}

// Is told which share is done, 0 to 1. Error: CANCELLED.
using Enter = std::function<absl::Status(double done)>;

// The shared effects, fitted jointly, with whatever each kind shows beside them.
absl::StatusOr<JointExplanation> ExplainWith(const Sides& sides, std::vector<SharedEffect> shared,
                                             std::vector<OwnEffects> own, const Enter& enter) {
  const auto steps = static_cast<double>(1 + kJointRules.passes * sides.size());
  int done = 0;
  TOUCHSTONE_RETURN_IF_ERROR(enter(done++ / steps));
  JointExplanation best{std::move(shared), std::move(own), {}};
  TOUCHSTONE_ASSIGN_OR_RETURN(best.fit, FitJointly(PartsOf(sides, best)));
  for (int pass = 0; pass < kJointRules.passes; ++pass) {
    JointExplanation next = best;
    for (SharedEffect& effect : next.shared) effect = WithValues(effect, best.fit);
    bool same = true;
    for (const Side& side : sides) {
      TOUCHSTONE_RETURN_IF_ERROR(enter(done++ / steps));
      engine::Explanation explanation;
      explanation.initial_effects = side.InitialEffects(next.shared);
      explanation.fit.model = side.Held(next.shared, best.own[side.kind]);
      TOUCHSTONE_ASSIGN_OR_RETURN(explanation, side.own_search->Continue(std::move(explanation)));
      next.own[side.kind] = side.OwnOf(explanation.fit, explanation.initial_effects);
      same &= next.own[side.kind].Key() == best.own[side.kind].Key();
    }
    if (same) break;
    TOUCHSTONE_ASSIGN_OR_RETURN(next.fit, FitJointly(PartsOf(sides, next)));
    if (next.fit.log_evidence <= best.fit.log_evidence) break;
    best = std::move(next);
  }
  for (SharedEffect& effect : best.shared) effect = WithValues(effect, best.fit);
  return best;
}

}  // namespace

std::vector<std::string> OwnBeside(const JointExplanation& one, const JointExplanation& other) {
  std::vector<std::string> beside;
  for (size_t kind = 0; kind < one.own.size(); ++kind) {
    const std::vector<std::string> others = other.own[kind].Names();
    for (const std::string& name : one.own[kind].Names())
      if (std::find(others.begin(), others.end(), name) == others.end()) beside.push_back(name);
  }
  return beside;
}

std::vector<Part> PartsOf(const Sides& sides, const JointExplanation& explained) {
  std::vector<Part> parts;
  for (const Side& side : sides)
    parts.push_back({&side.modality->experiment(), side.Free(explained.shared, explained.own[side.kind]), 1});
  return parts;
}

absl::StatusOr<SharedSelection> SearchShared(
    const Sides& sides, const std::function<absl::Status(const std::string& tried, double done)>& enter) {
  std::vector<OwnEffects> own;
  for (const Side& side : sides) own.push_back(side.own_alone());
  SharedSelection selection;
  TOUCHSTONE_ASSIGN_OR_RETURN(
      selection.none, ExplainWith(sides, {}, own, [&](double done) { return enter("", kWithout * done); }));
  TOUCHSTONE_RETURN_IF_ERROR(enter("", kWithout));
  selection.best = selection.none;
  for (int round = 0; round < kJointRules.max_shared; ++round) {
    TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<Form> forms, ListForms(sides, selection.best));
    if (round == 0) TOUCHSTONE_RETURN_IF_ERROR(AddFormsHiddenByOwn(sides, own, &forms));
    int chosen = -1;
    std::vector<JointExplanation> tried;
    for (const Form& form : forms) {
      std::vector<SharedEffect> shared = selection.best.shared;
      shared.push_back(form.effect);
      // From what the best has; and, since what each kind shows by itself may have stood in for the effect, afresh.
      const std::vector<OwnEffects> starts[] = {selection.best.own, own,
                                                std::vector<OwnEffects>(sides.size())};
      std::optional<JointExplanation> with;
      for (size_t start = 0; start < std::size(starts); ++start) {
        const auto of_round = [&](double done) {
          const double tries = static_cast<double>(start) + done,
                       of_forms = static_cast<double>(tried.size()) + tries / std::size(starts);
          const double share = 1 - std::ldexp(2 - of_forms / static_cast<double>(forms.size()), -round - 1);
          return enter(form.effect.name(), kWithout + (1 - kWithout) * share);
        };
        TOUCHSTONE_ASSIGN_OR_RETURN(JointExplanation afresh,
                                    ExplainWith(sides, shared, starts[start], of_round));
        if (!with || afresh.fit.log_evidence > with->fit.log_evidence) with = std::move(afresh);
      }
      tried.push_back(*std::move(with));
      if (IsWorthIt(sides, selection.best, tried.back(), forms.size()) &&
          (chosen < 0 || tried.back().fit.log_evidence > tried[chosen].fit.log_evidence))
        chosen = static_cast<int>(tried.size()) - 1;
    }
    if (round == 0 || chosen >= 0) selection.tried.insert(selection.tried.end(), tried.begin(), tried.end());
    if (chosen < 0) break;
    selection.best = tried[chosen];
  }
  return selection;
}

}  // namespace touchstone::diagnosis::joint
