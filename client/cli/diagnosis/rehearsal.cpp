#include "client/cli/diagnosis/rehearsal.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/base/numbers/distributions.h"
#include "server/base/numbers/normal.h"
#include "server/base/numbers/random.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/effects/all_effects.h"

namespace touchstone::cli {
namespace {

constexpr double kConfident = 0.9;
// What is outside: a travel that follows the azimuth of the normal three times round, which no effect of the catalogue does.
constexpr char kOutsideTerm[] = "k*cos(3*atan2(normal_y, normal_x))";
constexpr char kOutsideMm[] = "k=0.5";

const v1::DetectableEffect* FirstOf(const v1::Report& check, const std::string& effect) {
  for (const v1::DetectableEffect& value : check.detectable())
    if (value.effect() == effect) return &value;
  return nullptr;
}

// "radius_mm=1.5", "offset_mm=0.2,-0.2,0": the effect's first value of this size. Where values sum to zero, the second takes
// the opposite, as a fit moves them.
std::string FirstValue(const model::Effect& effect, int fingers, double size) {
  const model::ParameterInfo& parameter = effect.parameters[0];
  std::vector<std::string> entries(parameter.Count(fingers), ShortestNumber(parameter.neutral));
  entries[0] = ShortestNumber(parameter.reciprocal ? size : parameter.neutral + size);
  if (parameter.sum_zero && entries.size() > 1) entries[1] = ShortestNumber(-size);
  return absl::StrCat(parameter.name, "=", absl::StrJoin(entries, ","));
}

absl::StatusOr<model::Model> Hiding(const model::Model& given, const v1::DetectableEffect& value,
                                    const HiddenSize& size) {
  const auto effect = effects::Catalogue().Find(value.effect());
  const double of_file = size.found                         ? value.found_from()
                         : effect->parameters[0].reciprocal ? value.typical() / size.times_typical
                                                            : value.typical() * size.times_typical;
  return model::AddEffect(given, value.effect(), {FirstValue(*effect, given.fingers, of_file)},
                          effects::Catalogue());
}

bool Names(const v1::Step& step, const std::string& effect) {
  return step.effect() == effect ||
         std::count(step.equivalent().begin(), step.equivalent().end(), effect) > 0;
}

// The hidden value of a parameter's entry, in the unit of files; NaN: it is not hidden.
double TruthOf(const RehearsedCase& hidden, const std::string& effect, const v1::ParameterValue& value) {
  for (const model::EffectInstance& instance : hidden.model.effects) {
    if (instance.effect->name != effect) continue;
    int offset = 0;
    for (const model::ParameterInfo& parameter : instance.effect->parameters) {
      const int count = parameter.Count(hidden.model.fingers);
      if (parameter.name == value.name()) {
        int entry = 0;
        const std::string fingers =
            hidden.model.fingers == 3 && parameter.arity == model::Arity::kPerFinger ? "lmr" : "xyz";
        if (!value.finger().empty()) {
          const size_t at = fingers.find(value.finger());
          entry = at == std::string::npos ? std::atoi(value.finger().c_str()) : static_cast<int>(at);
        }
        return FromSi(parameter.unit, instance.values[offset + std::min(entry, count - 1)]);
      }
      offset += count;
    }
  }
  return NAN;
}

}  // namespace

absl::StatusOr<std::vector<RehearsedCase>> ListCases(const model::Model& given, const v1::Report& check,
                                                     const HiddenSize& size,
                                                     const std::vector<std::string>& only, int pairs,
                                                     uint64_t seed, int sessions) {
  std::vector<std::string> names;
  for (const v1::DetectableEffect& value : check.detectable())
    if (names.empty() || names.back() != value.effect()) names.push_back(value.effect());
  for (const std::string& name : only)
    if (std::find(names.begin(), names.end(), name) == names.end())
      return absl::InvalidArgumentError(
          absl::StrCat("--effects: '", name, "' is no effect that this model lacks and touches can show",
                       DidYouMean(name, names)));
  if (!only.empty()) names = only;
  if (size.found)  // what is never found has no such size
    names.erase(
        std::remove_if(names.begin(), names.end(),
                       [&](const std::string& name) { return !FirstOf(check, name)->has_found_from(); }),
        names.end());
  std::vector<RehearsedCase> cases = {{"nothing", {}, given}};
  for (const std::string& name : names) {
    const v1::DetectableEffect& value = *FirstOf(check, name);
    TOUCHSTONE_ASSIGN_OR_RETURN(model::Model model, Hiding(given, value, size));
    cases.push_back({name, {name}, std::move(model)});
    if (size.found) cases.back().predicted = 0.8;
    if (!size.found && size.times_typical == 1) cases.back().predicted = value.power_at_typical();
  }
  RandomStream random(seed, RandomDomain::kDiagnosis, 41);
  for (int pair = 0; pair < pairs && names.size() > 1; ++pair) {
    const size_t one = random.Below(names.size());
    const size_t other = (one + 1 + random.Below(names.size() - 1)) % names.size();
    TOUCHSTONE_ASSIGN_OR_RETURN(model::Model model, Hiding(given, *FirstOf(check, names[one]), size));
    TOUCHSTONE_ASSIGN_OR_RETURN(model, Hiding(model, *FirstOf(check, names[other]), size));
    cases.push_back(
        {absl::StrCat(names[one], "+", names[other]), {names[one], names[other]}, std::move(model)});
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(
      model::Model outside,
      model::AddEffect(given, "formula",
                       {"name=rehearsed", "adds=travel_mm", absl::StrCat("expression=", kOutsideTerm),
                        kOutsideMm, "k_unit=mm", "k_min=-5", "k_max=5"},
                       effects::Catalogue()));
  cases.push_back({"outside", {}, std::move(outside), true});
  cases.push_back({"mistake", {}, given, false, true});
  for (size_t i = 0; sessions > 1 && i < names.size(); ++i) {
    TOUCHSTONE_ASSIGN_OR_RETURN(model::Model model, Hiding(given, *FirstOf(check, names[i]), size));
    cases.push_back({absl::StrCat(names[i], " changed"), {names[i]}, std::move(model), false, false, true});
  }
  for (RehearsedCase& one : cases) one.given = given;
  return cases;
}

namespace {

bool Names(const v1::ComparedEffect& compared, const std::string& effect) {
  return compared.effect() == effect ||
         std::count(compared.equivalent().begin(), compared.equivalent().end(), effect) > 0;
}

// Of several sessions: what is said to have changed.
void AssessChanges(const RehearsedCase& hidden, const v1::Report& report, RehearsedSet* set) {
  bool found = false;
  for (const v1::ComparedEffect& compared : report.sessions().effects()) {
    if (compared.change() != v1::ComparedEffect::CHANGED) continue;
    const bool is_hidden =
        hidden.last_only && std::any_of(hidden.effects.begin(), hidden.effects.end(),
                                        [&](const std::string& effect) { return Names(compared, effect); });
    found |= is_hidden;
    set->false_claim |= !is_hidden;
    set->confident |= !is_hidden;
  }
  if (hidden.last_only) set->found = found;
}

}  // namespace

RehearsedSet Assess(const RehearsedCase& hidden, const v1::Report& report) {
  RehearsedSet set;
  set.name = hidden.name;
  size_t found = 0;
  for (const std::string& effect : hidden.effects)
    found += std::any_of(report.steps().begin(), report.steps().end(),
                         [&](const v1::Step& step) { return Names(step, effect); });
  set.found = found == hidden.effects.size();
  for (const v1::Step& step : report.steps()) {
    const bool is_hidden = std::any_of(hidden.effects.begin(), hidden.effects.end(),
                                       [&](const std::string& effect) { return Names(step, effect); });
    // Of what has no name, and of noise, a step is no cause that is made up.
    const bool made_up = !is_hidden && !effects::Catalogue().Find(step.effect())->random();
    set.false_claim |= made_up;
    set.confident |= made_up && step.probability() >= kConfident;
    if (hidden.last_only ||
        std::find(hidden.effects.begin(), hidden.effects.end(), step.effect()) == hidden.effects.end())
      continue;
    for (const v1::ParameterValue& value : step.parameters()) {
      const double truth = TruthOf(hidden, step.effect(), value);
      if (std::isfinite(truth) && value.std_error() > 0)
        set.z.push_back((value.value() - truth) / value.std_error());
    }
  }
  AssessChanges(hidden, report, &set);
  const bool checks = report.verdict() == v1::Report::CHECK_DATA;
  set.confident |= checks && !hidden.is_mistake;
  // What is said to remain, or to have another value, is made up where all that is hidden has a name.
  const bool is_nothing = hidden.effects.empty() && !hidden.is_mistake && !hidden.is_outside;
  set.false_claim |= !hidden.is_mistake && !hidden.is_outside && report.verdict() == v1::Report::UNEXPLAINED;
  set.false_claim |= is_nothing && report.verdict() == v1::Report::WRONG_VALUES;
  if (hidden.is_mistake)
    set.found = set.right = checks;
  else if (hidden.is_outside)
    set.found = set.right = report.verdict() == v1::Report::UNEXPLAINED;
  else if (is_nothing)
    set.right = report.verdict() == v1::Report::ADEQUATE && !set.false_claim;
  else
    set.right = set.found && !set.false_claim && !checks;
  return set;
}

Json ToJson(const RehearsedSet& set) {
  if (set.left_out) return {{"case", set.name}, {"left_out", true}};
  return {{"case", set.name},           {"found", set.found},
          {"right", set.right},         {"false_claim", set.false_claim},
          {"confident", set.confident}, {"z", set.z}};
}

absl::StatusOr<RehearsedSet> SetFromJson(const Json& json) {
  RehearsedSet set;
  try {
    json.at("case").get_to(set.name);
    set.left_out = json.value("left_out", false);
    if (set.left_out) return set;
    json.at("found").get_to(set.found);
    json.at("right").get_to(set.right);
    json.at("false_claim").get_to(set.false_claim);
    json.at("confident").get_to(set.confident);
    json.at("z").get_to(set.z);
  } catch (const Json::exception& error) {
    return absl::DataLossError(absl::StrCat("is no set of a rehearsal: ", error.what()));
  }
  return set;
}

Interval95 IntervalOf(int count, int of) {
  if (of == 0) return {};
  return {count == 0 ? 0 : BetaQuantile(0.025, count, of - count + 1),
          count == of ? 1 : BetaQuantile(0.975, count + 1, of - count)};
}

std::vector<RehearsalRow> Summarise(const std::vector<RehearsedCase>& cases,
                                    const std::vector<RehearsedSet>& sets) {
  std::vector<RehearsalRow> rows;
  const auto add = [](const RehearsedSet& set, RehearsalRow* row) {
    ++row->sets;
    row->found += set.found, row->right += set.right, row->honest += set.honest(),
        row->confident += set.confident;
    for (const double z : set.z) {
      ++row->values;
      row->covered += std::abs(z) <= kNormalQuantile975;
      row->mean_z += z, row->spread_z += z * z;
    }
  };
  for (const RehearsedCase& one : cases) {
    rows.push_back({one.name});
    rows.back().predicted = one.predicted;
    for (const RehearsedSet& set : sets)
      if (set.name == one.name && !set.left_out) add(set, &rows.back());
  }
  rows.push_back({"all"});
  for (const RehearsedSet& set : sets)
    if (!set.left_out) add(set, &rows.back());
  for (RehearsalRow& row : rows) {
    if (row.values == 0) continue;
    row.mean_z /= row.values;
    row.spread_z = std::sqrt(std::max(row.spread_z / row.values - row.mean_z * row.mean_z, 0.0));
  }
  return rows;
}

}  // namespace touchstone::cli
